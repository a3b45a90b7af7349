import { go } from '../route';
import { maps, problem, retry } from '../store';
import { count, time } from './format';

export function MapsPage() {
  const list = maps.value;
  const wrong = problem.value;
  return (
    <main class="page" id="main">
      <header class="page-head"><h1>Maps</h1></header>
      {wrong && (
        <section class="empty" role="alert">
          <h2>The maps cannot be listed</h2>
          <p>{wrong.message}</p>
          <p><button class="primary" onClick={retry}>Try again</button></p>
        </section>
      )}
      {!wrong && list === null && <p class="faint">Loading…</p>}
      {list?.length === 0 && (
        <section class="empty">
          <h2>No map yet</h2>
          <p>Make one, and upload a first drive:</p>
          <code>mapkeep map create yard{'\n'}mapkeep session upload yard DIR --wait</code>
        </section>
      )}
      <ul class="cards">
        {(list ?? []).map((m) => (
          <li key={m.name}>
            <button onClick={() => go({ map: m.name, page: 'map', epoch: null, from: null })}>
              <b>{m.name}</b>
              <span>{count(m.staticVoxels)} static voxels · epoch {m.epoch}</span>
              <span class="faint">{count(m.sessions)} sessions{m.crs ? ` · ${m.crs}` : ''} · made {time(m.created)}</span>
            </button>
          </li>
        ))}
      </ul>
    </main>
  );
}
