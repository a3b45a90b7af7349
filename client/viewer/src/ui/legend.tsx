// What the colours say.

import { colour } from '../route';
import { status } from '../stage_state';
import { ramps, type ColourMode } from '../view/ramps';
import { days } from './format';

export const modeNames: Record<ColourMode, string> = {
  height: 'Height',
  stability: 'Stability R',
  ground: 'Ground',
  age: 'Age',
  intensity: 'Intensity',
};

const meanings: Record<ColourMode, string> = {
  height: 'Metres above the map’s origin',
  stability: 'Share of the looks at a voxel that hit it',
  ground: 'What the last session held to be ground',
  age: 'Since a session first hit the voxel',
  intensity: 'Share of the light that comes back',
};

function ends(mode: ColourMode): [string, string] {
  const now = status.value;
  if (mode === 'height') return [`${(now?.heights[0] ?? 0).toFixed(1)} m`, `${(now?.heights[1] ?? 10).toFixed(1)} m`];
  if (mode === 'age') return ['new', days(Math.round(now?.oldestDays ?? 1))];
  return mode === 'stability' ? ['0', '1'] : ['0 %', '100 %'];
}

export const gradientOf = (ramp: string[]): string => `linear-gradient(to right, ${ramp.join(', ')})`;

export function Legend() {
  const mode = colour.value;
  const [low, high] = ends(mode);
  return (
    <div class="legend">
      {mode === 'ground' ? (
        <ul class="swatches">
          <li><i style={{ background: ramps.ground[1] }} />Ground</li>
          <li><i style={{ background: ramps.ground[0] }} />Stands on it</li>
        </ul>
      ) : (
        <>
          <div class="ramp" style={{ background: gradientOf(ramps[mode]) }} />
          <div class="ends"><span>{low}</span><span>{high}</span></div>
        </>
      )}
      <p class="faint">{meanings[mode]}</p>
    </div>
  );
}
