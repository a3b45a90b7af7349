// One epoch of a map as its 3D Tiles: loads what the view needs, and keeps what is drawn under a budget of points.

import { TilesRenderer } from '3d-tiles-renderer';
import { ImplicitTilingPlugin } from '3d-tiles-renderer/core/plugins';
import { Box3, type Object3D, type PerspectiveCamera, type Sphere, type WebGLRenderer } from 'three';
import { authHeaders } from '../api/api';
import type { PointMaterial } from './point_material';
import { tilePointsIn, type TilePoints } from './tile_points';

// Pixels. A tile's geometric error is eight times the distance of its points (core/tiling), so that at an error of 8 the
// points that are shown lie a pixel apart.
const errorOfSpacing = 8;
const finestError = 10;
const coarsestError = 400;
const firstError = 64; // something to see at once; finer levels follow
const cacheBytes = 512 * 2 ** 20;

interface LoadedTile {
  engineData?: { scene?: Object3D | null };
}

export interface LayerCallbacks {
  /** Something arrived or wants to be drawn. */
  changed(): void;
  failed(error: Error): void;
}

export class TileLayer {
  readonly tiles: TilesRenderer;
  /** All tiles that the last view asked for are there. */
  settled = false;
  drawnPoints = 0;
  /** Pixels between the points on the screen, where finer ones exist. */
  spacing = 1;
  loadedPoints = 0;
  private readonly clouds = new Map<Object3D, TilePoints[]>();
  private rootLoaded = false;
  private failures = 0;
  private coarsened = false;

  constructor(
    readonly epoch: number,
    url: string,
    material: PointMaterial,
    camera: PerspectiveCamera,
    callbacks: LayerCallbacks,
  ) {
    const tiles = new TilesRenderer(url);
    this.tiles = tiles;
    tiles.registerPlugin(new ImplicitTilingPlugin());
    tiles.registerPlugin({
      name: 'MAPKEEP_POINTS',
      processTileModel: async (scene: Object3D) => {
        this.clouds.set(scene, tilePointsIn(scene, material));
      },
    });
    tiles.fetchOptions = { headers: authHeaders() };
    tiles.errorTarget = firstError;
    tiles.lruCache.maxBytesSize = cacheBytes;
    tiles.lruCache.minBytesSize = cacheBytes / 2;
    tiles.setCamera(camera);
    tiles.addEventListener('load-root-tileset', () => {
      this.rootLoaded = true;
      callbacks.changed();
    });
    tiles.addEventListener('load-model', () => callbacks.changed());
    tiles.addEventListener('tiles-load-end', () => callbacks.changed());
    tiles.addEventListener('needs-update', () => callbacks.changed());
    tiles.addEventListener('dispose-model', ({ scene }: { scene: Object3D }) => {
      this.clouds.delete(scene);
    });
    tiles.addEventListener('load-error', ({ error }: { error: Error }) => {
      ++this.failures;
      callbacks.failed(error);
      callbacks.changed();
    });
  }

  get failed(): boolean {
    return this.failures > 0 && !this.rootLoaded;
  }

  /** Whether the tree of tiles is known; it may still be empty. */
  get opened(): boolean {
    return this.rootLoaded;
  }

  get bounds(): Box3 | null {
    const box = new Box3();
    return this.rootLoaded && this.tiles.getBoundingBox(box) && !box.isEmpty() ? box : null;
  }

  getSphere(into: Sphere): boolean {
    return this.rootLoaded && this.tiles.getBoundingSphere(into);
  }

  retry(): void {
    this.failures = 0;
    this.tiles.resetFailedTiles();
  }

  /** After a move of the camera a finer level is worth a try again. */
  viewMoved(): void {
    this.coarsened = false;
  }

  visible(): TilePoints[] {
    const found: TilePoints[] = [];
    for (const tile of this.tiles.visibleTiles) {
      const scene = (tile as LoadedTile).engineData?.scene;
      const clouds = scene ? this.clouds.get(scene) : undefined;
      if (clouds) found.push(...clouds);
    }
    return found;
  }

  /** All that is loaded, shown or not. */
  loaded(): TilePoints[] {
    return [...this.clouds.values()].flat();
  }

  /** Chooses tiles for the camera, and draws of them `most` points or less. */
  update(camera: PerspectiveCamera, renderer: WebGLRenderer, budget: number, most: number): void {
    this.tiles.setResolutionFromRenderer(camera, renderer);
    this.tiles.update();
    const visible = this.visible();
    const total = visible.reduce((sum, cloud) => sum + cloud.count, 0);
    const share = total > most ? most / total : 1;
    this.loadedPoints = total;
    this.spacing = this.tiles.errorTarget / errorOfSpacing / Math.sqrt(Math.max(share, 0.01));
    this.drawnPoints = visible.reduce((sum, cloud) => sum + cloud.thin(share), 0);
    const idle = this.rootLoaded && this.tiles.loadProgress >= 1;
    this.settled = !this.adapt(total, budget, idle) && idle;
  }

  /** Levels are chosen so that about a budget of points is loaded; true if that asks for other tiles. */
  private adapt(total: number, budget: number, idle: boolean): boolean {
    const before = this.tiles.errorTarget;
    if (total > 1.5 * budget && before < coarsestError) {
      this.coarsened = true;
      this.tiles.errorTarget = Math.min(coarsestError, before * 1.5);
    } else if (idle && !this.coarsened && total < 0.4 * budget && before > finestError) {
      this.tiles.errorTarget = Math.max(finestError, before / 1.5);
    }
    return this.tiles.errorTarget !== before;
  }

  dispose(): void {
    this.tiles.dispose();
    this.clouds.clear();
  }
}
