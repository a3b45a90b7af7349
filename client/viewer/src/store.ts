// What is known of the daemon's maps, kept true while the page is open.

import { batch, computed, effect, signal, untracked } from '@preact/signals';
import { ApiError, getMap, listEpochs, listMaps, listSessions, onUnauthorized, setToken } from './api/api';
import { listenToMap } from './api/live';
import type { Epoch, MapInfo, Session } from './api/wire';
import { go, mapName, route } from './route';

export const maps = signal<MapInfo[] | null>(null);
export const map = signal<MapInfo | null>(null);
/** Newest first, as the daemon lists them. */
export const epochs = signal<Epoch[]>([]);
/** Begun last first. */
export const sessions = signal<Session[] | null>(null);
export const problem = signal<ApiError | null>(null);
export const live = signal<'connecting' | 'live' | 'broken'>('connecting');
export const needsToken = signal(false);
export const notes = signal<{ id: number; text: string; kind: 'info' | 'error' }[]>([]);

/** Epochs that can be looked at, oldest first; the empty one only if there is no other. */
export const timeline = computed(() => {
  const readable = epochs.value.filter((e) => e.readable).reverse();
  const filled = readable.filter((e) => e.epoch > 0);
  return filled.length > 0 ? filled : readable;
});

/** The epoch on show: the asked one if it can be read, else the newest. */
export const currentEpoch = computed<number | null>(() => {
  const asked = route.value.epoch;
  const list = timeline.value;
  if (asked !== null && list.some((e) => e.epoch === asked)) return asked;
  return list[list.length - 1]?.epoch ?? null;
});

/** What the epoch on show is compared with. */
export const beforeEpoch = computed<number | null>(() => {
  const current = currentEpoch.value;
  const earlier = timeline.value.filter((e) => current !== null && e.epoch < current);
  const asked = route.value.from;
  if (asked !== null && earlier.some((e) => e.epoch === asked)) return asked;
  return earlier[earlier.length - 1]?.epoch ?? null;
});

/** Whoever keeps something about the map on show lets go of it here. */
export const whenMapChanges: (() => void)[] = [];

let lastNote = 0;

export function tell(text: string, kind: 'info' | 'error' = 'info'): void {
  if (untracked(() => notes.value.some((n) => n.text === text))) return;
  const id = ++lastNote;
  notes.value = [...notes.value, { id, text, kind }].slice(-3);
  window.setTimeout(() => dismiss(id), kind === 'error' ? 10000 : 6000);
}

export function dismiss(id: number): void {
  notes.value = notes.value.filter((n) => n.id !== id);
}

function report(error: unknown): void {
  if (error instanceof ApiError) {
    if (error.status !== 401) problem.value = error;
  } else {
    problem.value = new ApiError(0, 'INTERNAL', error instanceof Error ? error.message : String(error));
  }
}

let firstLook = true;

export async function loadMaps(): Promise<void> {
  try {
    const list = await listMaps();
    maps.value = list;
    if (!route.value.map) problem.value = null;
    // One map: that is what somebody comes for. Who goes back to the list wants the list.
    const only = firstLook && list.length === 1 ? list[0] : undefined;
    firstLook = false;
    if (only && !route.value.map) go({ map: only.name, page: 'map' });
  } catch (error) {
    if (!route.value.map) report(error); // else what is asked about the map itself tells
  }
}

/** Asks for everything about a map again; answers to an older question are dropped. */
async function refresh(name: string): Promise<void> {
  try {
    const [info, list, drives] = await Promise.all([getMap(name), listEpochs(name), listSessions(name)]);
    if (route.value.map !== name) return;
    batch(() => {
      map.value = info;
      epochs.value = list;
      sessions.value = drives;
      problem.value = null;
    });
  } catch (error) {
    if (route.value.map === name) report(error);
  }
}

function changed(session: Session): void {
  const list = sessions.value ?? [];
  const old = list.find((s) => s.id === session.id);
  sessions.value = old ? list.map((s) => (s === old ? session : s)) : [session, ...list];
  if (old?.state === session.state) return;
  if (session.state === 'refused') tell(`Session ${session.id} was refused: ${session.reason}`, 'error');
  if (session.state === 'failed') tell(`Session ${session.id} failed: ${session.reason}`, 'error');
}

async function epochCame(name: string, epoch: number): Promise<void> {
  await refresh(name);
  const made = epochs.value.find((e) => e.epoch === epoch);
  if (made?.kind === 'session') tell(`Epoch ${epoch}: session ${made.session} was merged into the map`);
  else if (made?.kind === 'rollback') tell(`Epoch ${epoch}: the map was rolled back to epoch ${made.baseEpoch}`);
}

const tokens = signal(0); // grows when another token is given, so that all is asked again

/** Starts following the address; gives what stops it. */
export function start(): () => void {
  onUnauthorized(() => (needsToken.value = true));
  return effect(() => {
    const name = mapName.value;
    void tokens.value;
    batch(() => {
      map.value = null;
      epochs.value = [];
      sessions.value = null;
      problem.value = null;
      live.value = 'connecting';
      for (const forget of whenMapChanges) forget();
    });
    void untracked(() => loadMaps());
    if (!name) return;
    void untracked(() => refresh(name));
    let broke = false;
    return listenToMap(name, {
      opened: () => {
        live.value = 'live';
        if (broke) void refresh(name);
        broke = false;
      },
      broken: () => {
        broke = true;
        live.value = 'broken';
      },
      epoch: (epoch) => void epochCame(name, epoch),
      session: changed,
    });
  });
}

export function giveToken(token: string): void {
  setToken(token);
  needsToken.value = false;
  ++tokens.value;
}

export function retry(): void {
  ++tokens.value;
}
