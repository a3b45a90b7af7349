// What the pipeline found out about one session.

import type { FitnessWindow, Report, Session } from '../api/wire';
import { colourAt, ramps } from '../view/ramps';
import { fitnessRange } from '../view/trajectories';
import { count, duration, metres, percent } from './format';

export function SessionReport({ session, report }: { session: Session; report: Report }) {
  const total = report.stages.reduce((sum, s) => sum + s.seconds, 0);
  return (
    <div class="report-grid">
      <section>
        <h2>Stages</h2>
        {report.stages.length === 0 && <p class="faint">None has ended yet.</p>}
        <ul class="stages">
          {report.stages.map((s) => (
            <li key={s.stage}>
              <span class="name">{s.stage}</span>
              <span class="bar" aria-hidden="true"><i style={{ width: `${total > 0 ? (100 * s.seconds) / total : 0}%` }} /></span>
              <span>{duration(s.seconds)}</span>
            </li>
          ))}
        </ul>
      </section>
      <section>
        <h2>Points and voxels</h2>
        <dl class="facts">
          <dt>Points</dt><dd>{count(report.points)}</dd>
          <dt>Removed, as moving</dt><dd>{count(report.pointsRemoved)}</dd>
          <dt>Given back</dt><dd>{count(report.pointsRestored)}</dd>
          <dt>Voxels seen</dt><dd>{count(report.sessionVoxels)}</dd>
          <dt>Voxels kept</dt><dd>{count(report.voxelsKept)}</dd>
          <dt>Blocks written</dt><dd>{count(report.blocksTouched)}</dd>
        </dl>
      </section>
      <section class="wide">
        <h2>Windows</h2>
        {report.windows.length === 0 ? (
          <p class="faint">{session.state === 'committed' ? 'None: this session founded the map.' : 'None yet.'}</p>
        ) : (
          <Windows windows={report.windows} />
        )}
      </section>
    </div>
  );
}

function Windows({ windows }: { windows: FitnessWindow[] }) {
  const trusted = windows.filter((w) => w.trusted).length;
  const worst = windows.reduce((least, w) => Math.min(least, w.fitness), 1);
  const moved = windows.reduce((most, w) => Math.max(most, w.correction), 0);
  const hue = (fitness: number) => {
    const [r, g, b] = colourAt(ramps.fitness, (fitness - fitnessRange[0]) / (fitnessRange[1] - fitnessRange[0]));
    return `rgb(${Math.round(255 * r)}, ${Math.round(255 * g)}, ${Math.round(255 * b)})`;
  };
  return (
    <>
      <p>
        {trusted} of {windows.length} trusted · fitness {percent(worst)} at the worst · moved by {metres(moved)} at most
      </p>
      <div class="windows" role="img" aria-label={`Fitness of ${windows.length} windows along the session, ${percent(worst)} at the worst`}>
        {windows.map((w) => (
          <i
            key={w.firstScan}
            class={w.trusted ? '' : 'distrusted'}
            style={{ height: `${100 * Math.max(w.fitness, 0.03)}%`, background: hue(w.fitness) }}
            title={`Scans ${w.firstScan} to ${w.lastScan}: fitness ${percent(w.fitness, 1)}, ${count(w.inliers)} inliers, moved ${metres(w.correction)}${w.trusted ? '' : ', not trusted'}`}
          />
        ))}
      </div>
    </>
  );
}
