// The record of the voxel that somebody clicked, or what was measured.

import type { Vec3, Voxel } from '../api/wire';
import { asked, measured, tool } from '../stage_state';
import { colourAt, ramps } from '../view/ramps';
import { count, metres, percent, time } from './format';
import { Icon } from './icons';

const coordinates = (p: Vec3): string => p.map((c) => c.toFixed(2)).join('  ');

export function PointCard() {
  if (tool.value === 'measure') return <MeasureCard />;
  const now = asked.value;
  if (!now) return null;
  return (
    <section class="card" aria-label="Voxel" aria-live="polite">
      <header>
        <h2>Voxel</h2>
        <button class="round" aria-label="Close" onClick={() => (asked.value = null)}><Icon name="close" /></button>
      </header>
      <p class="coordinates">{coordinates(now.point)}</p>
      {now.state === 'asking' && <p class="faint">Asking…</p>}
      {now.state === 'missing' && <p>{now.message}</p>}
      {now.state === 'found' && <Record voxel={now.voxel} />}
    </section>
  );
}

function Record({ voxel }: { voxel: Voxel }) {
  const [r, g, b] = colourAt(ramps.stability, voxel.stability);
  return (
    <>
      <div class="gauge" role="img" aria-label={`Stability ${voxel.stability.toFixed(2)}`}>
        <i style={{ width: percent(voxel.stability, 1).replace(' ', ''), background: `rgb(${Math.round(255 * r)}, ${Math.round(255 * g)}, ${Math.round(255 * b)})` }} />
      </div>
      <dl class="facts">
        <dt>Stability R</dt><dd>{voxel.stability.toFixed(3)}</dd>
        <dt>Hits H</dt><dd>{voxel.hits.toFixed(1)} scans</dd>
        <dt>Exposures E</dt><dd>{voxel.exposures.toFixed(1)} scans</dd>
        <dt>Ground</dt><dd>{voxel.ground ? 'yes' : 'no'}</dd>
        <dt>Static</dt><dd>{voxel.isStatic ? 'yes' : voxel.isNew ? 'if a second session meets it' : 'no'}</dd>
        <dt>Intensity</dt><dd>{percent(voxel.intensity)}</dd>
        <dt>First seen</dt><dd>{time(voxel.firstSeen)}</dd>
        <dt>Last seen</dt><dd>{time(voxel.lastSeen)}</dd>
        <dt>Epoch</dt><dd>{count(voxel.epoch)}</dd>
      </dl>
    </>
  );
}

function MeasureCard() {
  const [a, b] = measured.value;
  const stop = () => {
    tool.value = 'look';
    measured.value = [];
  };
  return (
    <section class="card" aria-label="Distance" aria-live="polite">
      <header>
        <h2>Distance</h2>
        <button class="round" aria-label="Stop measuring" onClick={stop}><Icon name="close" /></button>
      </header>
      {!a && <p class="faint">Click or tap the first point.</p>}
      {a && !b && <p class="faint">Now the second point.</p>}
      {a && b && (
        <dl class="facts">
          <dt>Distance</dt><dd class="big">{metres(Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]))}</dd>
          <dt>Along the ground</dt><dd>{metres(Math.hypot(b[0] - a[0], b[1] - a[1]))}</dd>
          <dt>Height</dt><dd>{metres(Math.abs(b[2] - a[2]))}</dd>
        </dl>
      )}
    </section>
  );
}
