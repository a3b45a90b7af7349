// What is fetched to be drawn over the map: trajectories and changes.

import { useEffect } from 'preact/hooks';
import { effect } from '@preact/signals';
import { bytes, changePointsUrl, countChanges, listPositions } from '../api/api';
import type { Vec3 } from '../api/wire';
import { mapName, page } from '../route';
import { changes, classesShown, drives, view } from '../stage_state';
import { beforeEpoch, currentEpoch, sessions, tell } from '../store';
import type { Trajectory } from '../view/trajectories';

const positions = new Map<string, Promise<Vec3[]>>();

function positionsOf(map: string, session: string): Promise<Vec3[]> {
  const key = `${map}/${session}`;
  let known = positions.get(key);
  if (!known) {
    known = listPositions(map, session);
    known.catch(() => positions.delete(key));
    positions.set(key, known);
  }
  return known;
}

export function useTrajectoryLayer(): void {
  useEffect(() => {
    let turn = 0;
    return effect(() => {
      const mine = ++turn;
      const made = view.value;
      const name = mapName.value;
      const wanted = (sessions.value ?? []).filter((s) => s.state === 'committed' && drives.value.has(s.id));
      if (!made || !name) return;
      const load = async (id: string): Promise<Trajectory> => ({
        session: id,
        positions: await positionsOf(name, id),
        windows: wanted.find((s) => s.id === id)?.report?.windows ?? [],
      });
      void Promise.allSettled(wanted.map((s) => load(s.id))).then((all) => {
        if (mine !== turn) return;
        made.showTrajectories(all.flatMap((one) => (one.status === 'fulfilled' ? [one.value] : [])));
        const failed = all.find((one) => one.status === 'rejected');
        if (failed) tell(`A trajectory could not be loaded: ${String((failed as PromiseRejectedResult).reason)}`, 'error');
      });
    });
  }, []);
}

export function useChangeLayer(): void {
  useEffect(() => {
    let turn = 0;
    let gone = new AbortController();
    const load = async (map: string, before: number, after: number) => {
      const mine = ++turn;
      gone.abort();
      gone = new AbortController();
      changes.value = { state: 'loading' };
      try {
        const [counts, glb] = await Promise.all([
          countChanges(map, before, after),
          bytes(changePointsUrl(map, before, after), gone.signal),
        ]);
        if (mine !== turn) return;
        await view.value?.showChanges(glb);
        if (mine === turn) changes.value = { state: 'ready', before, after, counts };
      } catch (error) {
        if (mine !== turn) return;
        await view.value?.showChanges(null);
        changes.value = { state: 'failed', message: error instanceof Error ? error.message : String(error) };
      }
    };
    const stops = [
      effect(() => {
        const before = beforeEpoch.value;
        const after = currentEpoch.value;
        if (!view.value) return;
        if (mapName.value && page.value === 'changes' && before !== null && after !== null) {
          void load(mapName.value, before, after);
        } else {
          ++turn;
          gone.abort();
          changes.value = null;
          void view.value.showChanges(null);
        }
      }),
      effect(() => {
        const { appeared, disappeared, unstable } = classesShown.value;
        view.value?.setClassesShown([appeared, disappeared, unstable]);
      }),
    ];
    return () => {
      for (const stop of stops) stop();
      gone.abort();
    };
  }, []);
}
