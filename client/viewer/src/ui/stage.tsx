// The canvas, and what lies directly over it.

import { useEffect, useRef } from 'preact/hooks';
import { effect } from '@preact/signals';
import { queryVoxel, tilesetUrl, ApiError } from '../api/api';
import type { Vec3 } from '../api/wire';
import { colour, mapName } from '../route';
import { asked, budget, measured, status, tool, view, viewProblem } from '../stage_state';
import { currentEpoch, map, tell } from '../store';
import { defaultBudget } from '../view/frame_budget';
import { MapView } from '../view/map_view';
import { count, metres, scaleBarLength, short } from './format';
import { useChangeLayer, useTrajectoryLayer } from './stage_layers';

const markColour = { look: '#4fd1c5', measure: '#ffd479' };

function picked(point: Vec3 | null): void {
  if (tool.value === 'measure') {
    if (point) measured.value = measured.value.length === 1 ? [...measured.value, point] : [point];
    return;
  }
  if (!point) {
    asked.value = null;
    return;
  }
  void askFor(point);
}

async function askFor(point: Vec3): Promise<void> {
  const name = mapName.value;
  const epoch = currentEpoch.value;
  if (!name || epoch === null) return;
  asked.value = { state: 'asking', point };
  try {
    const voxel = await queryVoxel(name, point, epoch);
    if (asked.value?.point === point) asked.value = { state: 'found', point, voxel };
  } catch (error) {
    if (asked.value?.point !== point) return;
    const gone = error instanceof ApiError && error.status === 404;
    const message = gone
      ? 'This point stands for several voxels. Zoom in and click again.'
      : error instanceof Error ? error.message : String(error);
    asked.value = { state: 'missing', point, message };
  }
}

/** Makes the view once, and keeps it doing what the page's state says. */
function useMapView(canvas: { current: HTMLCanvasElement | null }): void {
  useEffect(() => {
    if (!canvas.current) return;
    let made: MapView;
    try {
      made = new MapView(canvas.current, {
        status: (s) => (status.value = s),
        picked,
        failed: (message) => tell(`The map's tiles: ${message}`, 'error'),
      });
    } catch {
      viewProblem.value = 'This browser cannot draw in 3D: WebGL 2 is missing or switched off.';
      return;
    }
    budget.value = defaultBudget(made.softwareRendered);
    view.value = made;
    let shownMap: string | null = null;
    const stops = [
      effect(() => {
        const info = map.value;
        const epoch = currentEpoch.value;
        if (info?.name !== shownMap) made.clear();
        shownMap = info?.name ?? null;
        if (info && epoch !== null) made.showEpoch(epoch, tilesetUrl(info.name, epoch), info.voxelSize, info.bounds);
      }),
      effect(() => made.setColour(colour.value)),
      effect(() => made.setBudget(budget.value)),
      effect(() => {
        const points = tool.value === 'measure' ? measured.value : asked.value ? [asked.value.point] : [];
        made.mark(points, markColour[tool.value]);
      }),
    ];
    return () => {
      for (const stop of stops) stop();
      view.value = null;
      made.dispose();
    };
  }, []);
}

export function Stage({ hidden }: { hidden: boolean }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useMapView(canvas);
  useTrajectoryLayer();
  useChangeLayer();
  const now = status.value;
  const name = map.value?.name ?? '';
  return (
    <div class="stage" hidden={hidden}>
      <canvas
        ref={canvas}
        id="map-canvas"
        class={tool.value === 'measure' ? 'measuring' : ''}
        tabIndex={0}
        role="application"
        aria-label={`Map ${name} in 3D. Arrow keys move, plus and minus zoom, Enter asks about the middle, question mark lists all keys.`}
        data-state={now === null || now.epoch === null ? 'empty' : now.loading ? 'loading' : 'ready'}
        data-epoch={now?.epoch ?? ''}
        data-drawn={now?.drawnPoints ?? 0}
        data-loaded={now?.loadedPoints ?? 0}
      />
      <MeasureLabel />
      <StageFoot />
      <div class="crosshair" aria-hidden="true" />
      <LoadingBar />
      {viewProblem.value && <p class="stage-message" role="alert">{viewProblem.value}</p>}
      {map.value && map.value.epoch === 0 && (
        <div class="stage-message">
          <h2>This map is still empty</h2>
          <p>It shows here as soon as a first session is merged:</p>
          <code>mapkeep session upload {name} DIR --wait</code>
        </div>
      )}
    </div>
  );
}

function LoadingBar() {
  const busy = map.value !== null && map.value.epoch > 0 && (status.value?.loading ?? true);
  return <div class={`loading-bar${busy ? ' busy' : ''}`} aria-hidden="true" />;
}

function MeasureLabel() {
  const [a, b] = measured.value;
  const at = status.value?.label;
  if (tool.value !== 'measure' || !a || !b || !at) return null;
  const distance = Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
  return (
    <div class="measure-label" style={{ left: `${at.x}px`, top: `${at.y}px` }}>
      {metres(distance)}
    </div>
  );
}

function StageFoot() {
  const now = status.value;
  if (!now || now.epoch === null) return null;
  const length = scaleBarLength(now.metresPerPixel, 130);
  return (
    <div class="stage-foot">
      <div class="scale-bar" title="At the middle of the picture">
        <div class="scale-line" style={{ width: `${length / now.metresPerPixel}px` }} />
        <span>{length >= 1 ? `${count(length)} m` : `${Math.round(100 * length)} cm`}</span>
      </div>
      <span class="point-count">{short(now.drawnPoints)} points drawn</span>
    </div>
  );
}
