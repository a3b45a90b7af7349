// The daemon's HTTP interface, one function a question.

import {
  changesOf,
  epochOf,
  errorOf,
  listOf,
  mapOf,
  pageTokenOf,
  positionsOf,
  sessionOf,
  voxelOf,
  type Changes,
  type Epoch,
  type MapInfo,
  type Session,
  type Vec3,
  type Voxel,
} from './wire';

/** Status 0: nobody answered. */
export class ApiError extends Error {
  constructor(
    readonly status: number,
    readonly code: string,
    message: string,
  ) {
    super(message);
  }
}

const tokenKey = 'mapkeep.token';
const mostPages = 100;

let bearer = sessionStorage.getItem(tokenKey) ?? '';
let refused: () => void = () => {};

/** Calls back when the daemon wants a token, or another one. */
export function onUnauthorized(callback: () => void): void {
  refused = callback;
}

export function setToken(value: string): void {
  bearer = value;
  if (value) sessionStorage.setItem(tokenKey, value);
  else sessionStorage.removeItem(tokenKey);
}

export const hasToken = (): boolean => bearer !== '';

export const authHeaders = (): Record<string, string> => (bearer ? { Authorization: `Bearer ${bearer}` } : {});

const path = (map: string, rest = ''): string => `/v1/maps/${encodeURIComponent(map)}${rest}`;

export const tilesetUrl = (map: string, epoch: number): string => path(map, `/epochs/${epoch}/tileset.json`);

export const changePointsUrl = (map: string, before: number, after: number): string =>
  path(map, `/changes/${before}/${after}/points.glb`);

/** EventSource can send no header, so the token goes along in the address. */
export const eventsUrl = (map: string): string =>
  path(map, '/events') + (bearer ? `?token=${encodeURIComponent(bearer)}` : '');

async function ask(url: string, signal?: AbortSignal): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(url, { headers: authHeaders(), signal });
  } catch (error) {
    if (signal?.aborted) throw error;
    throw new ApiError(0, 'UNAVAILABLE', 'The map server does not answer.');
  }
  if (response.ok) return response;
  let detail = { code: '', message: '' };
  try {
    detail = errorOf(await response.json());
  } catch {
    // A proxy's own page, perhaps; the status says enough.
  }
  if (response.status === 401) refused();
  throw new ApiError(
    response.status,
    detail.code,
    detail.message || `The server answered ${response.status} ${response.statusText}`.trim(),
  );
}

const json = async (url: string, signal?: AbortSignal): Promise<unknown> => (await ask(url, signal)).json();

export const bytes = async (url: string, signal?: AbortSignal): Promise<ArrayBuffer> =>
  (await ask(url, signal)).arrayBuffer();

/** All pages of a list, at `url` up to its query. */
async function all<T>(url: string, name: string, item: (value: unknown) => T): Promise<T[]> {
  const found: T[] = [];
  let token = '';
  for (let i = 0; i < mostPages; ++i) {
    const answer = await json(`${url}?pageSize=500${token ? `&pageToken=${encodeURIComponent(token)}` : ''}`);
    found.push(...listOf(answer, name, item));
    token = pageTokenOf(answer);
    if (!token) break;
  }
  return found;
}

export const listMaps = (): Promise<MapInfo[]> => all('/v1/maps', 'maps', mapOf);

export const getMap = async (map: string): Promise<MapInfo> => mapOf(await json(path(map)));

/** Newest first. */
export const listEpochs = async (map: string): Promise<Epoch[]> =>
  listOf(await json(path(map, '/epochs?limit=1000')), 'epochs', epochOf);

/** Newest first. */
export const listSessions = async (map: string): Promise<Session[]> =>
  (await all(path(map, '/sessions'), 'sessions', sessionOf)).reverse();

/** Where the sensor was at each scan of a committed session. */
export async function listPositions(map: string, session: string): Promise<Vec3[]> {
  const positions: Vec3[] = [];
  for (let i = 0; i < mostPages; ++i) {
    const page = positionsOf(
      await json(path(map, `/sessions/${encodeURIComponent(session)}/poses?first=${positions.length}`)),
    );
    positions.push(...page.positions);
    if (page.positions.length === 0 || positions.length >= page.scanCount) break;
  }
  return positions;
}

export const countChanges = async (map: string, before: number, after: number): Promise<Changes> =>
  changesOf(await json(path(map, `/changes/${before}/${after}`)));

export async function queryVoxel(map: string, [x, y, z]: Vec3, epoch: number): Promise<Voxel> {
  return voxelOf(await json(path(map, `/voxel?x=${x}&y=${y}&z=${z}&epoch=${epoch}`)));
}
