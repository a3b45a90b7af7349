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

let token = sessionStorage.getItem(tokenKey) ?? '';
let refused: () => void = () => {};

/** Calls back when the daemon wants a token, or another one. */
export function onUnauthorized(callback: () => void): void {
  refused = callback;
}

export function setToken(value: string): void {
  token = value;
  if (value) sessionStorage.setItem(tokenKey, value);
  else sessionStorage.removeItem(tokenKey);
}

export const hasToken = (): boolean => token !== '';

export const authHeaders = (): Record<string, string> => (token ? { Authorization: `Bearer ${token}` } : {});

const path = (map: string, rest = ''): string => `/v1/maps/${encodeURIComponent(map)}${rest}`;

export const tilesetUrl = (map: string, epoch: number): string => path(map, `/epochs/${epoch}/tileset.json`);

export const changePointsUrl = (map: string, before: number, after: number): string =>
  path(map, `/changes/${before}/${after}/points.glb`);

/** EventSource can send no header, so the token goes along in the address. */
export const eventsUrl = (map: string): string =>
  path(map, '/events') + (token ? `?token=${encodeURIComponent(token)}` : '');

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

export const listMaps = async (): Promise<MapInfo[]> => listOf(await json('/v1/maps'), 'maps', mapOf);

export const getMap = async (map: string): Promise<MapInfo> => mapOf(await json(path(map)));

/** Newest first. */
export const listEpochs = async (map: string): Promise<Epoch[]> =>
  listOf(await json(path(map, '/epochs?limit=1000')), 'epochs', epochOf);

/** Newest first. */
export async function listSessions(map: string): Promise<Session[]> {
  const sessions: Session[] = [];
  let page = '';
  for (let i = 0; i < mostPages; ++i) {
    const query = `/sessions?pageSize=500${page ? `&pageToken=${encodeURIComponent(page)}` : ''}`;
    const answer = await json(path(map, query));
    sessions.push(...listOf(answer, 'sessions', sessionOf));
    page = pageTokenOf(answer);
    if (!page) break;
  }
  return sessions.reverse();
}

/** Where the sensor was at each scan of a committed session. */
export const listPositions = async (map: string, session: string): Promise<Vec3[]> =>
  positionsOf(await json(path(map, `/sessions/${encodeURIComponent(session)}/poses`)));

export const countChanges = async (map: string, before: number, after: number): Promise<Changes> =>
  changesOf(await json(path(map, `/changes/${before}/${after}`)));

export async function queryVoxel(map: string, [x, y, z]: Vec3, epoch: number): Promise<Voxel> {
  return voxelOf(await json(path(map, `/voxel?x=${x}&y=${y}&z=${z}&epoch=${epoch}`)));
}
