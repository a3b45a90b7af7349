// What the page shows, written as the part of its address behind '#': a link that somebody shares opens the same.

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
