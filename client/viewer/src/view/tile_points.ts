// The points of one loaded tile: thinned evenly to any number, measured, searched.

import { BufferAttribute, Matrix4, Points, Sphere, Vector3, type BufferGeometry, type Object3D, type ShaderMaterial } from 'three';
import type { PointMaterial } from './point_material';

function greatestCommonDivisor(a: number, b: number): number {
  while (b) [a, b] = [b, a % b];
  return a;
}

/** An order of 0 .. n-1 of which every beginning is spread evenly over the whole. */
export function spreadOrder(n: number): Uint32Array {
  const order = new Uint32Array(n);
  let step = Math.max(1, Math.round(n * 0.6180339887));
  while (greatestCommonDivisor(step, n) !== 1) ++step;
  for (let i = 0, at = 0; i < n; ++i) {
    order[i] = at;
    at += step;
    if (at >= n) at -= n;
  }
  return order;
}

const bytesAreShares = ['_stability', '_intensity'];

export class TilePoints {
  readonly count: number;
  private drawn: number;

  constructor(
    readonly points: Points,
    material: PointMaterial,
  ) {
    const geometry = points.geometry;
    this.count = geometry.getAttribute('position').count;
    this.drawn = this.count;
    geometry.setIndex(new BufferAttribute(spreadOrder(this.count), 1));
    for (const name of bytesAreShares) {
      const attribute = geometry.getAttribute(name);
      if (attribute && attribute.array instanceof Uint8Array) attribute.normalized = true;
    }
    geometry.computeBoundingSphere();
    points.material = material.forTile(geometry);
  }

  /** Draws this share of the points, [0, 1]; gives how many. */
  thin(share: number): number {
    this.drawn = Math.min(this.count, Math.floor(share * this.count));
    this.points.geometry.setDrawRange(0, this.drawn);
    return this.drawn;
  }

  dispose(): void {
    this.points.geometry.dispose();
    (this.points.material as ShaderMaterial).dispose();
  }

  get drawnCount(): number {
    return this.drawn;
  }

  /** About `most` of the heights in the world, in no order. */
  sampleHeights(most: number, into: number[]): void {
    const order = this.points.geometry.index?.array;
    const position = this.points.geometry.getAttribute('position');
    const p = new Vector3();
    for (let i = 0; i < Math.min(most, this.count); ++i) {
      p.fromBufferAttribute(position, order?.[i] ?? i).applyMatrix4(this.points.matrixWorld);
      into.push(p.z);
    }
  }

  oldest(): number {
    const age = this.points.geometry.getAttribute('_age');
    let most = 0;
    if (age) for (let i = 0; i < age.count; ++i) most = Math.max(most, age.getX(i));
    return most;
  }
}

/** All point clouds below a glTF scene. */
export function tilePointsIn(scene: Object3D, material: PointMaterial): TilePoints[] {
  const found: TilePoints[] = [];
  scene.updateMatrixWorld(true);
  scene.traverse((object) => {
    if (object instanceof Points) found.push(new TilePoints(object, material));
  });
  return found;
}

export interface Hit {
  point: Vector3;
  /** Pixels from where the pointer is. */
  off: number;
  depth: number;
}

const sphere = new Sphere();
const toClip = new Matrix4();

/**
 * The drawn point that somebody who points at (x, y) means: of those within `radius` pixels the nearest to the eye, a
 * pixel off counting as a per cent of the distance.
 */
export function pickPoint(
  tiles: Iterable<TilePoints>,
  viewProjection: Matrix4,
  x: number,
  y: number,
  width: number,
  height: number,
  radius: number,
): Hit | null {
  let best: Hit | null = null;
  let bestScore = Infinity;
  const p = new Vector3();
  for (const tile of tiles) {
    const geometry: BufferGeometry = tile.points.geometry;
    if (!geometry.boundingSphere) continue;
    sphere.copy(geometry.boundingSphere).applyMatrix4(tile.points.matrixWorld);
    toClip.multiplyMatrices(viewProjection, tile.points.matrixWorld);
    const m = toClip.elements as number[];
    const order = geometry.index?.array;
    const position = geometry.getAttribute('position');
    if (!order) continue;
    for (let k = 0; k < tile.drawnCount; ++k) {
      const i = order[k] as number;
      const px = position.getX(i);
      const py = position.getY(i);
      const pz = position.getZ(i);
      const w = (m[3] as number) * px + (m[7] as number) * py + (m[11] as number) * pz + (m[15] as number);
      if (w <= 0) continue;
      const sx = (0.5 + 0.5 * (((m[0] as number) * px + (m[4] as number) * py + (m[8] as number) * pz + (m[12] as number)) / w)) * width;
      const dx = sx - x;
      if (dx > radius || dx < -radius) continue;
      const sy = (0.5 - 0.5 * (((m[1] as number) * px + (m[5] as number) * py + (m[9] as number) * pz + (m[13] as number)) / w)) * height;
      const dy = sy - y;
      const off = Math.hypot(dx, dy);
      if (off > radius) continue;
      const score = w * (1 + 0.01 * off);
      if (score < bestScore) {
        bestScore = score;
        p.set(px, py, pz).applyMatrix4(tile.points.matrixWorld);
        best = { point: p.clone(), off, depth: w };
      }
    }
  }
  return best;
}
