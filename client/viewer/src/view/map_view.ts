// The picture: a canvas, a camera, the tiles of one epoch and what lies over them. Draws only when something changed.

import {
  Box3,
  Color,
  Matrix4,
  PerspectiveCamera,
  Scene,
  Sphere,
  Vector2,
  Vector3,
  WebGLRenderer,
  type Object3D,
} from 'three';
import { MapControls } from 'three/addons/controls/MapControls.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import type { Box, Vec3 } from '../api/wire';
import { listenForClicks } from './clicks';
import { distanceThatShows } from './framing';
import { FrameBudget, isSoftwareRenderer } from './frame_budget';
import { PointMaterial } from './point_material';
import type { ColourMode } from './ramps';
import { TileLayer } from './tile_layer';
import { pickPoint, tilePointsIn, type TilePoints } from './tile_points';
import { pointMarks, rulerLine, Trajectories, type Trajectory } from './trajectories';

export interface ViewStatus {
  epoch: number | null;
  drawnPoints: number;
  loadedPoints: number;
  loading: boolean;
  /** Colours run between these: metres, and days. */
  heights: [number, number];
  oldestDays: number;
  /** Metres that one pixel spans where the camera looks at. */
  metresPerPixel: number;
  /** Where labels of measured points belong, in pixels of the canvas; null when behind the camera. */
  label: { x: number; y: number } | null;
}

export interface ViewCallbacks {
  status(status: ViewStatus): void;
  /** Somebody clicked, tapped or pressed Enter; null: on nothing. */
  picked(point: Vec3 | null): void;
  failed(message: string): void;
}

const pickRadius = { mouse: 7, touch: 18 };
const up = new Vector3(0, 0, 1);
const restMilliseconds = 180; // without a move, after which the picture becomes full again
const swapPatience = 8000; // ms until a new epoch is shown though it is still loading

export class MapView {
  readonly softwareRendered: boolean;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(50, 1, 0.5, 5000);
  private readonly controls: MapControls;
  private readonly material = new PointMaterial();
  private readonly changeMaterial = new PointMaterial();
  private readonly trajectories = new Trajectories();
  private readonly ruler = rulerLine();
  private readonly marks = pointMarks();
  private readonly frames = new FrameBudget();
  private readonly sphere = new Sphere(new Vector3(), 50);
  private shown: TileLayer | null = null;
  private next: TileLayer | null = null;
  private nextSince = 0;
  private changes: { root: Object3D | null; clouds: TilePoints[] } = { root: null, clouds: [] };
  private budget = 1_000_000;
  private fitted = false;
  /** What the camera was made to show, until somebody moves it. */
  private framed: { box: Box3; fromAbove: boolean } | null = null;
  private finest = 0.05;
  private heights: [number, number] = [0, 10];
  private heightsKnown = false;
  private oldestDays = 1;
  private labelAt: Vec3 | null = null;
  private frame = 0;
  private restTimer = 0;
  private moving = false;
  private disposed = false;
  private readonly resizeObserver: ResizeObserver;

  /** Throws if the browser has no WebGL 2. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly callbacks: ViewCallbacks,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: false, powerPreference: 'high-performance' });
    this.softwareRendered = isSoftwareRenderer(this.renderer.getContext());
    const ratio = this.softwareRendered ? 1 : Math.min(window.devicePixelRatio, 2);
    this.renderer.setPixelRatio(ratio);
    this.scene.background = new Color('#0b0f15');
    this.camera.up.copy(up);
    this.camera.position.set(-60, -60, 60);
    this.changeMaterial.setMode('class');
    this.scene.add(this.trajectories.group, this.ruler.line, this.marks.group);

    this.controls = new MapControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.screenSpacePanning = false;
    this.controls.maxPolarAngle = 0.495 * Math.PI;
    this.controls.minDistance = 2;
    this.controls.zoomToCursor = true;
    this.controls.keyPanSpeed = 30;
    this.controls.listenToKeyEvents(canvas);
    this.controls.addEventListener('start', () => (this.framed = null));
    this.controls.addEventListener('change', () => this.moved());
    listenForClicks(canvas, (x, y, touch) => callbacks.picked(this.pickAt(x, y, touch ? pickRadius.touch : pickRadius.mouse)));
    this.resizeObserver = new ResizeObserver(() => this.resize());
    this.resizeObserver.observe(canvas);
    canvas.addEventListener('webglcontextlost', (event) => {
      event.preventDefault();
      callbacks.failed('The graphics card was lost; reload the page to go on.');
    });
    this.resize();
  }

  /** Shows another epoch once its first tiles are there; the one before stays until then. */
  showEpoch(epoch: number, url: string, voxelSize: number, bounds: Box | null): void {
    this.finest = voxelSize / 4;
    if (this.next?.epoch === epoch || (!this.next && this.shown?.epoch === epoch)) return;
    this.dropNext();
    if (this.shown?.epoch === epoch) {
      this.invalidate();
      return;
    }
    if (bounds && !this.fitted) this.fit(bounds);
    this.next = new TileLayer(epoch, url, this.material, this.camera, {
      changed: () => this.invalidate(),
      failed: (error) => this.callbacks.failed(error.message),
    });
    this.next.tiles.group.visible = this.shown === null;
    this.nextSince = performance.now();
    this.scene.add(this.next.tiles.group);
    this.invalidate();
  }

  clear(): void {
    this.dropNext();
    this.shown?.dispose();
    this.shown = null;
    this.fitted = false;
    this.framed = null;
    this.heightsKnown = false;
    this.invalidate();
  }

  retry(): void {
    this.shown?.retry();
    this.next?.retry();
    this.invalidate();
  }

  setColour(mode: ColourMode): void {
    this.material.setMode(mode);
    this.invalidate();
  }

  setBudget(points: number): void {
    this.budget = points;
    this.shown?.viewMoved();
    this.invalidate();
  }

  /** Points with _CLASS as a glTF; the map steps back behind them. Null: none. */
  async showChanges(glb: ArrayBuffer | null): Promise<void> {
    for (const cloud of this.changes.clouds) cloud.dispose();
    this.changes.root?.removeFromParent();
    this.changes = { root: null, clouds: [] };
    this.material.setFade(glb ? 0.86 : 0);
    if (glb && glb.byteLength > 0) {
      const { scene } = await new GLTFLoader().parseAsync(glb, '');
      scene.rotation.x = Math.PI / 2; // glTF has y up
      const clouds = tilePointsIn(scene, this.changeMaterial);
      this.scene.add(scene);
      this.changes = { root: scene, clouds };
    }
    this.invalidate();
  }

  setClassesShown(shown: [boolean, boolean, boolean]): void {
    this.changeMaterial.setClassesShown(shown);
    this.invalidate();
  }

  showTrajectories(trajectories: Trajectory[]): void {
    this.trajectories.show(trajectories);
    this.invalidate();
  }

  /** The points that are measured or asked about; two are joined by a line with a label. */
  mark(points: Vec3[], colour: string): void {
    this.marks.set(points, colour);
    this.ruler.set(points.length > 1 ? points : []);
    const [a, b] = points;
    this.labelAt = a && b ? [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2] : null;
    this.invalidate();
  }

  /** The whole map, seen from the south-west and from above, or straight from above. */
  home(fromAbove = false): void {
    const box = this.shown?.bounds ?? this.next?.bounds;
    if (box) this.lookAtBox(box, fromAbove);
  }

  zoom(factor: number): void {
    this.framed = null;
    const offset = this.camera.position.clone().sub(this.controls.target).multiplyScalar(factor);
    if (offset.length() < this.controls.minDistance) offset.setLength(this.controls.minDistance);
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.invalidate();
  }

  /** What lies at the middle of the picture: for those who point with keys. */
  pickCentre(): void {
    this.callbacks.picked(this.pickAt(this.canvas.clientWidth / 2, this.canvas.clientHeight / 2, pickRadius.touch));
  }

  dispose(): void {
    this.disposed = true;
    cancelAnimationFrame(this.frame);
    window.clearTimeout(this.restTimer);
    this.resizeObserver.disconnect();
    this.controls.dispose();
    this.clear();
    this.material.dispose();
    this.changeMaterial.dispose();
    this.trajectories.clear();
    this.renderer.dispose();
  }

  private fit(bounds: Box): void {
    this.lookAtBox(new Box3(new Vector3(...bounds.min), new Vector3(...bounds.max)), false);
  }

  private lookAtBox(box: Box3, fromAbove: boolean): void {
    box.getBoundingSphere(this.sphere);
    const size = box.getSize(new Vector3());
    const centre = box.getCenter(new Vector3());
    const direction = fromAbove ? new Vector3(0, -0.001, 1) : new Vector3(-0.35, -0.85, 0.75).normalize();
    this.controls.target.copy(centre).setZ(box.min.z + 0.25 * size.z);
    const distance = distanceThatShows(this.camera, this.controls.target, direction, box, 20 * this.sphere.radius + 100);
    this.camera.position.copy(this.controls.target).addScaledVector(direction, distance);
    this.controls.maxDistance = 8 * this.sphere.radius + 50;
    this.controls.update();
    this.fitted = true;
    this.framed = { box: box.clone(), fromAbove };
    this.invalidate();
  }

  private moved(): void {
    this.moving = true;
    window.clearTimeout(this.restTimer);
    this.restTimer = window.setTimeout(() => {
      this.moving = false;
      this.frames.rest();
      this.invalidate();
    }, restMilliseconds);
    this.shown?.viewMoved();
    this.next?.viewMoved();
    this.invalidate();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    const size = new Vector2(width, height);
    this.trajectories.resize(size);
    this.ruler.resize(size);
    if (this.framed) this.lookAtBox(this.framed.box, this.framed.fromAbove);
    this.invalidate();
  }

  private pickAt(x: number, y: number, radius: number): Vec3 | null {
    if (!this.shown) return null;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.camera.updateMatrixWorld();
    const viewProjection = new Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse);
    const hit = pickPoint(this.shown.visible(), viewProjection, x, y, width, height, radius);
    return hit ? hit.point.toArray() : null;
  }

  private dropNext(): void {
    this.next?.dispose();
    this.next = null;
  }

  /** Asks for a frame. Until nothing more is to be drawn the canvas says so, for those who look at pictures of it. */
  private invalidate(): void {
    if (this.frame || this.disposed) return;
    this.canvas.dataset.pending = 'yes';
    this.frame = requestAnimationFrame((time) => {
      this.frame = 0;
      this.draw(time);
    });
  }

  private draw(time: number): void {
    const most = this.frames.begin(time, this.moving, this.budget);
    const layer = this.shown ?? this.next;
    this.camera.updateMatrixWorld();
    const distance = Math.max(this.camera.position.distanceTo(this.controls.target), 1);
    this.camera.near = Math.max(0.1, distance / 500);
    this.camera.far = distance + 20 * this.sphere.radius + 500;
    this.camera.updateProjectionMatrix();

    this.shown?.update(this.camera, this.renderer, this.budget, most);
    this.next?.update(this.camera, this.renderer, this.budget, this.shown ? 0 : most);
    const bounds = this.fitted ? null : layer?.bounds;
    if (bounds) this.lookAtBox(bounds, false);
    this.swapWhenReady();
    this.measureRanges();

    const halfHeight = Math.tan((this.camera.fov * Math.PI) / 360);
    const pixels = this.renderer.domElement.height;
    this.material.setSpacing(this.finest, this.shown?.spacing ?? 1);
    this.material.setPixelsPerMetre(pixels / (2 * halfHeight), this.renderer.getPixelRatio());
    this.changeMaterial.setSpacing(this.finest, 1.4);
    this.changeMaterial.setPixelsPerMetre((1.5 * pixels) / (2 * halfHeight), this.renderer.getPixelRatio());
    const mark = (0.008 * distance * halfHeight) / 0.466;
    for (const child of this.marks.group.children) child.scale.setScalar(mark);
    this.renderer.render(this.scene, this.camera);
    this.frames.end(this.shown?.drawnPoints ?? 0);

    this.callbacks.status(this.status(distance, halfHeight));
    const loading = this.next !== null || (this.shown !== null && !this.shown.settled);
    if (loading) this.invalidate();
    if (!this.frame && !this.moving) this.canvas.dataset.pending = 'no';
  }

  private swapWhenReady(): void {
    const next = this.next;
    if (!next) return;
    const waited = performance.now() - this.nextSince > swapPatience && next.loadedPoints > 0;
    const empty = next.opened && next.settled && next.loadedPoints === 0;
    if (this.shown === null ? !next.opened && !next.failed : !next.settled && !waited && !empty) return;
    if (next.failed) return;
    this.shown?.dispose();
    next.tiles.group.visible = true;
    this.shown = next;
    this.next = null;
    this.invalidate();
  }

  /** Heights between which colours run, without the few highest and lowest; the same for all epochs of a map. */
  private measureRanges(): void {
    const layer = this.shown;
    if (!layer || (this.heightsKnown && !layer.settled)) return;
    const clouds = layer.loaded();
    if (clouds.length === 0) return;
    const oldest = clouds.reduce((most, cloud) => Math.max(most, cloud.oldest()), 0);
    if (oldest > this.oldestDays) {
      this.oldestDays = oldest;
      this.material.setAgeRange(oldest);
    }
    if (this.heightsKnown) return;
    const heights: number[] = [];
    for (const cloud of clouds) cloud.sampleHeights(Math.ceil(20000 / clouds.length), heights);
    heights.sort((a, b) => a - b);
    const at = (share: number) => heights[Math.floor(share * (heights.length - 1))] ?? 0;
    this.heights = [at(0.01), Math.max(at(0.985), at(0.01) + 1)];
    this.material.setHeightRange(...this.heights);
    this.heightsKnown = layer.settled;
  }

  private status(distance: number, halfHeight: number): ViewStatus {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    let label: ViewStatus['label'] = null;
    if (this.labelAt) {
      const p = new Vector3(...this.labelAt).project(this.camera);
      if (p.z < 1) label = { x: (0.5 + 0.5 * p.x) * width, y: (0.5 - 0.5 * p.y) * height };
    }
    return {
      epoch: this.shown?.epoch ?? null,
      drawnPoints: this.shown?.drawnPoints ?? 0,
      loadedPoints: this.shown?.loadedPoints ?? 0,
      loading: this.next !== null || (this.shown !== null && !this.shown.settled),
      heights: this.heights,
      oldestDays: this.oldestDays,
      metresPerPixel: (2 * distance * halfHeight) / Math.max(height, 1),
      label,
    };
  }
}
