// What somebody does with the picture: tools, layers over it, and what it said last.

import { signal } from '@preact/signals';
import type { Changes, Vec3, Voxel } from './api/wire';
import { whenMapChanges } from './store';
import type { MapView, ViewStatus } from './view/map_view';

export type Tool = 'look' | 'measure';

/** Null until the canvas is there, or for good if the browser has no WebGL 2. */
export const view = signal<MapView | null>(null);
export const viewProblem = signal<string | null>(null);
export const status = signal<ViewStatus | null>(null);

export const tool = signal<Tool>('look');
/** Zero, one or two points. */
export const measured = signal<Vec3[]>([]);

export type Asked =
  | { state: 'asking'; point: Vec3 }
  | { state: 'found'; point: Vec3; voxel: Voxel }
  | { state: 'missing'; point: Vec3; message: string };
export const asked = signal<Asked | null>(null);

export const budget = signal(1_000_000);
/** Ids of the sessions whose trajectories are drawn. */
export const drives = signal<ReadonlySet<string>>(new Set());

export const classesShown = signal({ appeared: true, disappeared: true, unstable: true });
export type ChangesState =
  | { state: 'loading' }
  | { state: 'ready'; before: number; after: number; counts: Changes }
  | { state: 'failed'; message: string };
export const changes = signal<ChangesState | null>(null);

export const helpOpen = signal(false);
/** On small screens: whether the panel covers the lower half. */
export const panelOpen = signal(false);

whenMapChanges.push(() => {
  measured.value = [];
  asked.value = null;
  drives.value = new Set();
  tool.value = 'look';
});
