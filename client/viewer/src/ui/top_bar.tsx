import { hashOf, type Page } from '../address';
import { go, mapName, route } from '../route';
import { hasToken } from '../api/api';
import { giveToken, live, maps } from '../store';

const tabs: { page: Page; name: string }[] = [
  { page: 'map', name: 'Map' },
  { page: 'changes', name: 'Changes' },
  { page: 'sessions', name: 'Sessions' },
];

const liveNames = { connecting: 'connecting', live: 'live', broken: 'reconnecting' };

export function TopBar() {
  const name = mapName.value;
  return (
    <header class="top-bar">
      <a class="brand" href="#/maps-list" onClick={(event) => {
        event.preventDefault();
        go({ map: null, page: 'map', epoch: null, from: null, session: null });
      }} aria-label="Mapkeep, all maps">
        <svg viewBox="0 0 32 32" aria-hidden="true"><path d="M6 23V10l7 6 3-3 3 3 7-6v13" /><circle cx="6" cy="10" r="2" /><circle cx="26" cy="10" r="2" /><circle cx="16" cy="13" r="2" /></svg>
        <span>Mapkeep</span>
      </a>
      {name !== null && (
        <>
          <label class="map-choice">
            <span class="unseen">Map</span>
            <select value={name} onChange={(event) => go({ map: event.currentTarget.value, epoch: null, from: null, session: null })}>
              {(maps.value ?? []).some((m) => m.name === name) ? null : <option value={name}>{name}</option>}
              {(maps.value ?? []).map((m) => <option key={m.name} value={m.name}>{m.name}</option>)}
            </select>
          </label>
          <nav aria-label="Pages of this map">
            {tabs.map((tab) => (
              <a
                key={tab.page}
                href={hashOf({ ...route.value, page: tab.page })}
                aria-current={route.value.page === tab.page ? 'page' : undefined}
                onClick={(event) => {
                  event.preventDefault();
                  go({ page: tab.page });
                }}
              >{tab.name}</a>
            ))}
          </nav>
          <span class={`live ${live.value}`} role="status"><i aria-hidden="true" />{liveNames[live.value]}</span>
        </>
      )}
      {hasToken() && <button class="link sign-out" onClick={() => giveToken('')}>Forget token</button>}
    </header>
  );
}
