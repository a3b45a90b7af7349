// Every session of the map: where it is on its way, what the pipeline found, why it was refused.

import { useState } from 'preact/hooks';
import type { Session, SessionState } from '../api/wire';
import { go, route } from '../route';
import { drives } from '../stage_state';
import { map, sessions } from '../store';
import { count, duration, percent, short, time } from './format';
import { meanFitness } from './look_panel';
import { progressOf } from './progress';
import { SessionReport } from './session_report';

const filters = ['all', 'running', 'committed', 'refused'] as const;
type Filter = (typeof filters)[number];

const members: Record<Filter, SessionState[] | null> = {
  all: null,
  running: ['uploading', 'queued', 'running'],
  committed: ['committed'],
  refused: ['refused', 'failed', 'rolled back'],
};
const filterNames: Record<Filter, string> = { all: 'All', running: 'Under way', committed: 'Committed', refused: 'Not merged' };
const mostRows = 500;

export function SessionsPage() {
  const [filter, setFilter] = useState<Filter>('all');
  const list = sessions.value;
  const wanted = members[filter];
  const shown = (list ?? []).filter((s) => wanted === null || wanted.includes(s.state));
  const number = (f: Filter) => (list ?? []).filter((s) => members[f]?.includes(s.state) ?? true).length;
  return (
    <main class="page" id="main">
      <header class="page-head">
        <h1>Sessions <span class="faint">of {map.value?.name ?? '…'}</span></h1>
        <div class="segments" role="group" aria-label="Which sessions">
          {filters.map((f) => (
            <button key={f} aria-pressed={filter === f} onClick={() => setFilter(f)}>
              {filterNames[f]} <span class="faint">{number(f)}</span>
            </button>
          ))}
        </div>
      </header>
      {list === null && <p class="faint">Loading…</p>}
      {list?.length === 0 && (
        <section class="empty">
          <h2>No session yet</h2>
          <p>Upload a drive, and watch here how it becomes part of the map:</p>
          <code>mapkeep session upload {map.value?.name ?? 'MAP'} DIR --wait</code>
        </section>
      )}
      {list !== null && list.length > 0 && shown.length === 0 && <p class="faint">None of them.</p>}
      <ul class="sessions">
        {shown.slice(0, mostRows).map((s) => <Row key={s.id} session={s} open={route.value.session === s.id} />)}
      </ul>
      {shown.length > mostRows && <p class="faint">The {mostRows} newest of {count(shown.length)}.</p>}
    </main>
  );
}

function Row({ session, open }: { session: Session; open: boolean }) {
  const progress = progressOf(session);
  const fitness = meanFitness(session);
  const removed = session.report && session.report.points > 0 ? session.report.pointsRemoved / session.report.points : null;
  const took = session.report?.stages.reduce((sum, s) => sum + s.seconds, 0) ?? 0;
  const id = `report-${session.id}`;
  return (
    <li class={`session ${open ? 'open' : ''}`}>
      <button class="session-head" aria-expanded={open} aria-controls={id} onClick={() => go({ session: open ? null : session.id })}>
        <span class={`state ${session.state.replace(' ', '-')}`}>{session.state}</span>
        <span class="name">{session.id}</span>
        <span class="faint">{session.robot || 'no robot named'}</span>
        <span class="faint">{time(session.startTime || session.created)}</span>
        <span class="figures">
          <span>{count(session.scanCount)} scans</span>
          {fitness !== null && <span>fit {percent(fitness)}</span>}
          {removed !== null && <span>{percent(removed, 1)} removed</span>}
          {took > 0 && <span>{duration(took)}</span>}
        </span>
      </button>
      {progress && (
        <div class="progress">
          <progress max={1} value={progress.share} aria-label={`Session ${session.id}`} />
          <span>{progress.text}</span>
        </div>
      )}
      {session.reason && <p class="reason">{session.reason}</p>}
      {open && (
        <div class="report" id={id}>
          {session.report ? <SessionReport session={session} report={session.report} /> : <p class="faint">The report comes with the first stage that ends.</p>}
          {session.state === 'committed' && (
            <p>
              <button class="quiet" onClick={() => {
                drives.value = new Set([session.id]);
                go({ page: 'map', epoch: session.report?.epoch || null });
              }}>Show on the map</button>
              {session.report?.epoch ? <span class="faint"> as of epoch {session.report.epoch}, {short(session.report.staticVoxels)} static voxels in its blocks</span> : null}
            </p>
          )}
        </div>
      )}
    </li>
  );
}
