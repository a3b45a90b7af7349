// What the daemon answers, as values: protobuf's JSON leaves out zeros and writes 64-bit numbers as strings, which ends
// here. Lengths are metres, times seconds since 1970 (UTC).

export type Raw = Record<string, unknown>;

export type Vec3 = [number, number, number];

export interface Box {
  min: Vec3;
  max: Vec3;
}

export interface MapInfo {
  name: string;
  voxelSize: number;
  origin: Vec3 | null;
  crs: string;
  epoch: number;
  created: number;
  voxels: number;
  staticVoxels: number;
  tiles: number;
  sessions: number;
  bounds: Box | null;
}

export interface Epoch {
  epoch: number;
  time: number;
  session: string;
  baseEpoch: number;
  kind: 'empty' | 'session' | 'rollback';
  readable: boolean;
  staticVoxels: number;
  touchedTiles: number;
  tags: string[];
}

export type SessionState =
  | 'uploading'
  | 'queued'
  | 'running'
  | 'committed'
  | 'refused'
  | 'failed'
  | 'rolled back'
  | 'unknown';

export interface FitnessWindow {
  firstScan: number;
  lastScan: number;
  fitness: number;
  inliers: number;
  correction: number;
  trusted: boolean;
}

export interface Report {
  windows: FitnessWindow[];
  stages: { stage: string; seconds: number }[];
  points: number;
  pointsRemoved: number;
  pointsRestored: number;
  sessionVoxels: number;
  voxelsKept: number;
  staticVoxels: number;
  blocksTouched: number;
  baseEpoch: number;
  epoch: number;
}

export interface Session {
  map: string;
  id: string;
  robot: string;
  state: SessionState;
  scanCount: number;
  durableScans: number;
  created: number;
  ended: number;
  startTime: number;
  stage: string;
  stageProgress: number;
  reason: string;
  report: Report | null;
}

export interface Changes {
  appeared: number;
  disappeared: number;
  unstable: number;
}

export interface Voxel {
  epoch: number;
  hits: number;
  exposures: number;
  stability: number;
  ground: boolean;
  isStatic: boolean;
  isNew: boolean;
  firstSeen: number;
  lastSeen: number;
  mean: Vec3;
  intensity: number;
}

const record = (value: unknown): Raw => (typeof value === 'object' && value !== null ? (value as Raw) : {});
const list = (value: unknown): unknown[] => (Array.isArray(value) ? value : []);
const text = (value: unknown): string => (typeof value === 'string' ? value : '');

function number(value: unknown): number {
  const n = Number(value ?? 0);
  return Number.isFinite(n) ? n : 0;
}

function point(value: unknown): Vec3 {
  const p = record(value);
  return [number(p.x), number(p.y), number(p.z)];
}

export function mapOf(value: unknown): MapInfo {
  const m = record(value);
  return {
    name: text(m.name),
    voxelSize: number(m.voxelSize),
    origin: m.origin ? point(m.origin) : null,
    crs: text(m.crs),
    epoch: number(m.epoch),
    created: number(m.created),
    voxels: number(m.voxels),
    staticVoxels: number(m.staticVoxels),
    tiles: number(m.tiles),
    sessions: number(m.sessions),
    bounds: m.bounds ? { min: point(record(m.bounds).min), max: point(record(m.bounds).max) } : null,
  };
}

export function epochOf(value: unknown): Epoch {
  const e = record(value);
  const epoch = number(e.epoch);
  const session = text(e.session);
  return {
    epoch,
    time: number(e.time),
    session,
    baseEpoch: number(e.baseEpoch),
    kind: e.rollback === true || e.kind === 'rollback' ? 'rollback' : session ? 'session' : 'empty',
    readable: e.readable === true,
    staticVoxels: number(e.staticVoxels),
    touchedTiles: number(e.touchedTiles),
    tags: list(e.tags).map(text),
  };
}

const states: Record<string, SessionState> = {
  SESSION_STATE_UPLOADING: 'uploading',
  SESSION_STATE_QUEUED: 'queued',
  SESSION_STATE_RUNNING: 'running',
  SESSION_STATE_COMMITTED: 'committed',
  SESSION_STATE_REFUSED: 'refused',
  SESSION_STATE_FAILED: 'failed',
  SESSION_STATE_ROLLED_BACK: 'rolled back',
};

function windowOf(value: unknown): FitnessWindow {
  const w = record(value);
  return {
    firstScan: number(w.firstScan),
    lastScan: number(w.lastScan),
    fitness: number(w.fitness),
    inliers: number(w.inliers),
    correction: number(w.correction),
    trusted: w.trusted === true,
  };
}

function reportOf(value: unknown): Report {
  const r = record(value);
  return {
    windows: list(r.windows).map(windowOf),
    stages: list(r.stages).map((s) => ({ stage: text(record(s).stage), seconds: number(record(s).seconds) })),
    points: number(r.points),
    pointsRemoved: number(r.pointsRemoved),
    pointsRestored: number(r.pointsRestored),
    sessionVoxels: number(r.sessionVoxels),
    voxelsKept: number(r.voxelsKept),
    staticVoxels: number(r.staticVoxels),
    blocksTouched: number(r.blocksTouched),
    baseEpoch: number(r.baseEpoch),
    epoch: number(r.epoch),
  };
}

export function sessionOf(value: unknown): Session {
  const s = record(value);
  return {
    map: text(s.map),
    id: text(s.id),
    robot: text(s.robot),
    state: states[text(s.state)] ?? 'unknown',
    scanCount: number(s.scanCount),
    durableScans: number(s.durableScans),
    created: number(s.created),
    ended: number(s.ended),
    startTime: number(s.startTime),
    stage: text(s.stage),
    stageProgress: number(s.stageProgress),
    reason: text(s.reason),
    report: s.report ? reportOf(s.report) : null,
  };
}

export function changesOf(value: unknown): Changes {
  const c = record(value);
  return { appeared: number(c.appeared), disappeared: number(c.disappeared), unstable: number(c.unstable) };
}

export function voxelOf(value: unknown): Voxel {
  const v = record(value);
  return {
    epoch: number(v.epoch),
    hits: number(v.hits),
    exposures: number(v.exposures),
    stability: number(v.stability),
    ground: v.ground === true,
    isStatic: v.isStatic === true,
    isNew: v.isNew === true,
    firstSeen: number(v.firstSeen),
    lastSeen: number(v.lastSeen),
    mean: point(v.mean),
    intensity: number(v.intensity),
  };
}

/** Positions of the sensor, one a scan, in the map's frame; and of how many scans in all. */
export function positionsOf(value: unknown): { positions: Vec3[]; scanCount: number } {
  const answer = record(value);
  const positions = list(answer.poses).map((p): Vec3 => {
    const rows = list(record(p).rows);
    return [number(rows[3]), number(rows[7]), number(rows[11])];
  });
  return { positions, scanCount: number(answer.scanCount) };
}

export const listOf = <T>(value: unknown, name: string, item: (value: unknown) => T): T[] =>
  list(record(value)[name]).map(item);

export const pageTokenOf = (value: unknown): string => text(record(value).nextPageToken);

export function errorOf(value: unknown): { code: string; message: string } {
  const e = record(record(value).error);
  return { code: text(e.code), message: text(e.message) };
}
