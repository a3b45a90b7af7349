// The page as a whole: which of its parts are there.

import { useEffect } from 'preact/hooks';
import { mapName, page } from '../route';
import { panelOpen, tool } from '../stage_state';
import { map, needsToken, problem, retry, start } from '../store';
import { ChangesPanel } from './changes_panel';
import { HelpDialog } from './help_dialog';
import { Icon } from './icons';
import { listenToKeys } from './keys';
import { LookPanel } from './look_panel';
import { MapsPage } from './maps_page';
import { Notes } from './notes';
import { PointCard } from './point_card';
import { SessionsPage } from './sessions_page';
import { Stage } from './stage';
import { Timeline } from './timeline';
import { TokenDialog } from './token_dialog';
import { Toolbar } from './toolbar';
import { TopBar } from './top_bar';
import { UnderWay } from './under_way';

export function App() {
  useEffect(() => start(), []);
  useEffect(() => listenToKeys(), []);
  const name = mapName.value;
  useEffect(() => {
    document.title = name ? `${name} – Mapkeep` : 'Mapkeep';
  }, [name]);
  return (
    <>
      <a class="skip" href="#main" onClick={(event) => {
        event.preventDefault();
        document.querySelector<HTMLElement>('#map-canvas, #main')?.focus();
      }}>Skip to the content</a>
      <TopBar />
      {name === null ? <MapsPage /> : <OneMap />}
      <Notes />
      <HelpDialog />
      {needsToken.value && <TokenDialog />}
    </>
  );
}

function OneMap() {
  const onSessions = page.value === 'sessions';
  const wrong = problem.value;
  const found = map.value !== null;
  return (
    <>
      {wrong && !found && (
        <main class="page" id="main">
          <section class="empty" role="alert">
            <h1>{wrong.status === 404 ? 'There is no such map' : 'The map cannot be shown'}</h1>
            <p>{wrong.message}</p>
            <p>
              <button class="primary" onClick={retry}>Try again</button> <a class="quiet" href="#/">All maps</a>
            </p>
          </section>
        </main>
      )}
      <div class="map-page" hidden={onSessions || (wrong !== null && !found)}>
        <main id={onSessions ? undefined : 'main'}>
          <h1 class="unseen">{mapName.value}: {page.value === 'changes' ? 'what changed' : 'the map'}</h1>
          <Stage hidden={false} />
          <Toolbar />
          <div class="corner">
            <PointCard />
            <UnderWay />
          </div>
          {found && <Timeline />}
        </main>
        <aside class={`panel ${panelOpen.value ? 'open' : ''}`} aria-label={page.value === 'changes' ? 'What changed' : 'How it is drawn'} data-tool={tool.value}>
          <button class="sheet-handle" aria-expanded={panelOpen.value} onClick={() => (panelOpen.value = !panelOpen.value)}>
            <Icon name="layers" /> {page.value === 'changes' ? 'Changes' : 'Layers'}
          </button>
          <div class="panel-body">{page.value === 'changes' ? <ChangesPanel /> : <LookPanel />}</div>
        </aside>
      </div>
      {onSessions && !(wrong && !found) && <SessionsPage />}
    </>
  );
}
