// What the page shows, as its address: a link that somebody shares opens the same.

import { computed, signal } from '@preact/signals';
import { colourModes, type ColourMode } from './view/ramps';

export type Page = 'map' | 'changes' | 'sessions';

export interface Route {
  /** Null: the list of maps. */
  map: string | null;
  page: Page;
  /** Null: the newest, also when a newer one comes. */
  epoch: number | null;
  /** What the epoch is compared with; null: the one before it. */
  from: number | null;
  colour: ColourMode;
  session: string | null;
}

const pages: Page[] = ['map', 'changes', 'sessions'];

export function parseRoute(hash: string): Route {
  const [path = '', query = ''] = hash.replace(/^#\/?/, '').split('?');
  const [map = '', page = ''] = path.split('/').map(decoded);
  const parameters = new URLSearchParams(query);
  const epoch = (name: string) => (/^\d+$/.test(parameters.get(name) ?? '') ? Number(parameters.get(name)) : null);
  return {
    map: map || null,
    page: pages.find((p) => p === page) ?? 'map',
    epoch: epoch('epoch'),
    from: epoch('from'),
    colour: colourModes.find((m) => m === parameters.get('colour')) ?? 'height',
    session: parameters.get('session'),
  };
}

function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return '';
  }
}

export function hashOf(route: Route): string {
  if (!route.map) return '#/';
  const parameters = new URLSearchParams();
  if (route.epoch !== null) parameters.set('epoch', String(route.epoch));
  if (route.from !== null && route.page === 'changes') parameters.set('from', String(route.from));
  if (route.colour !== 'height') parameters.set('colour', route.colour);
  if (route.session !== null && route.page === 'sessions') parameters.set('session', route.session);
  const query = parameters.toString();
  return `#/${encodeURIComponent(route.map)}/${route.page}${query ? `?${query}` : ''}`;
}

export const route = signal<Route>(parseRoute(location.hash));

// Each changes only when its own part of the address does.
export const mapName = computed(() => route.value.map);
export const page = computed(() => route.value.page);
export const colour = computed(() => route.value.colour);

window.addEventListener('hashchange', () => {
  route.value = parseRoute(location.hash);
});

/** Another page makes an entry in the browser's history, another epoch or colour does not. */
export function go(change: Partial<Route>): void {
  const next = { ...route.value, ...change };
  const step = next.map !== route.value.map || next.page !== route.value.page;
  route.value = next;
  history[step ? 'pushState' : 'replaceState'](null, '', hashOf(next));
}

window.addEventListener('popstate', () => {
  route.value = parseRoute(location.hash);
});
