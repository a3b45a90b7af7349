// How the map is drawn: colours, detail, trajectories.

import type { Session } from '../api/wire';
import { go, route } from '../route';
import { budget, drives, status } from '../stage_state';
import { map, sessions } from '../store';
import { colourModes, ramps } from '../view/ramps';
import { fitnessRange } from '../view/trajectories';
import { count, percent, short } from './format';
import { gradientOf, Legend, modeNames } from './legend';

const fewestPoints = 20_000;
const mostPoints = 10_000_000;

/** The slider is even in ratios: 0 is the fewest points, 100 the most. */
const pointsAt = (place: number) => Math.round((fewestPoints * (mostPoints / fewestPoints) ** (place / 100)) / 1e4) * 1e4;
const placeOf = (points: number) => (100 * Math.log(points / fewestPoints)) / Math.log(mostPoints / fewestPoints);

export function LookPanel() {
  const info = map.value;
  return (
    <>
      <fieldset class="modes">
        <legend>Colour by</legend>
        <div class="segments">
          {colourModes.map((mode) => (
            <label key={mode}>
              <input type="radio" name="colour" value={mode} checked={route.value.colour === mode} onChange={() => go({ colour: mode })} />
              <span>{modeNames[mode]}</span>
            </label>
          ))}
        </div>
      </fieldset>
      <Legend />
      <Drives />
      <Detail />
      {info && (
        <section>
          <h2>This map</h2>
          <dl class="facts">
            <dt>Static voxels</dt><dd>{count(info.staticVoxels)}</dd>
            <dt>Voxel</dt><dd>{Math.round(100 * info.voxelSize)} cm</dd>
            <dt>Sessions merged</dt><dd>{count(info.sessions)}</dd>
            {info.bounds && (
              <>
                <dt>Extent</dt>
                <dd>{[0, 1].map((i) => `${Math.round((info.bounds?.max[i] ?? 0) - (info.bounds?.min[i] ?? 0))} m`).join(' × ')}</dd>
              </>
            )}
            {info.crs && <><dt>Reference</dt><dd>{info.crs}</dd></>}
          </dl>
        </section>
      )}
    </>
  );
}

function Detail() {
  const now = status.value;
  return (
    <section>
      <h2><label for="budget">Detail</label></h2>
      <input
        id="budget"
        type="range"
        min={0}
        max={100}
        value={placeOf(budget.value)}
        aria-valuetext={`at most ${short(budget.value)} points`}
        onInput={(event) => (budget.value = pointsAt(Number(event.currentTarget.value)))}
      />
      <p class="faint">
        At most {short(budget.value)} points; {short(now?.drawnPoints ?? 0)} drawn now. Fewer are easier on a weak graphics card.
      </p>
    </section>
  );
}

/** The mean over a session's windows, each by its best guess; null for the session that founded the map. */
export function meanFitness(session: Session): number | null {
  const windows = session.report?.windows ?? [];
  if (windows.length === 0) return null;
  return windows.reduce((sum, w) => sum + w.fitness, 0) / windows.length;
}

function toggle(id: string, on: boolean): void {
  const next = new Set(drives.value);
  if (on) next.add(id);
  else next.delete(id);
  drives.value = next;
}

function Drives() {
  const driven = (sessions.value ?? []).filter((s) => s.state === 'committed');
  if (driven.length === 0) return null;
  const all = driven.every((s) => drives.value.has(s.id));
  return (
    <section>
      <h2 class="with-action">
        Trajectories
        <button class="link" onClick={() => (drives.value = new Set(all ? [] : driven.map((s) => s.id)))}>
          {all ? 'Hide all' : 'Show all'}
        </button>
      </h2>
      <ul class="checks">
        {driven.slice(0, 200).map((s) => {
          const fitness = meanFitness(s);
          return (
            <li key={s.id}>
              <label>
                <input type="checkbox" checked={drives.value.has(s.id)} onChange={(event) => toggle(s.id, event.currentTarget.checked)} />
                <span class="name">{s.id}</span>
                <span class="faint">{fitness === null ? 'founded the map' : `fit ${percent(fitness)}`}</span>
              </label>
            </li>
          );
        })}
      </ul>
      {drives.value.size > 0 && (
        <div class="legend">
          <div class="ramp" style={{ background: gradientOf(ramps.fitness) }} />
          <div class="ends"><span>{percent(fitnessRange[0])}</span><span>{percent(fitnessRange[1])}</span></div>
          <p class="faint">Fitness: share of a window’s points that lie on the map</p>
        </div>
      )}
    </section>
  );
}
