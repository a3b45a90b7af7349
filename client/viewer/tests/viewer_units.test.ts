// Parts of the viewer that need no browser.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Box3, BufferAttribute, BufferGeometry, Matrix4, PerspectiveCamera, Points, Vector3 } from 'three';
import { hashOf, parseRoute, type Route } from '../src/address';
import { epochOf, mapOf, positionsOf, sessionOf } from '../src/api/wire';
import { metres, scaleBarLength, short } from '../src/ui/format';
import { distanceThatShows } from '../src/view/framing';
import { FrameBudget } from '../src/view/frame_budget';
import { PointMaterial } from '../src/view/point_material';
import { colourAt, rampBytes, ramps, rgbOf } from '../src/view/ramps';
import { pickPoint, spreadOrder, TilePoints } from '../src/view/tile_points';
import { fitnessOfScans } from '../src/view/trajectories';

test('an order of points is one of all points, and every beginning is spread evenly', () => {
  for (const n of [0, 1, 2, 3, 7, 100, 4096, 9973, 65536]) {
    const order = spreadOrder(n);
    assert.deepEqual([...order].sort((a, b) => a - b), [...Array(n).keys()]);
  }
  const n = 10_000;
  const order = spreadOrder(n);
  for (const share of [0.05, 0.1, 0.5]) {
    const tenths = new Array<number>(10).fill(0);
    for (const i of order.subarray(0, share * n)) tenths[Math.floor((10 * i) / n)]! += 1;
    for (const count of tenths) assert.ok(Math.abs(count - (share * n) / 10) <= 2, `${share}: ${tenths.join(' ')}`);
  }
});

test('an address says all that is shown', () => {
  const route: Route = { map: 'a b/c', page: 'changes', epoch: 7, from: 3, colour: 'age', session: null };
  assert.deepEqual(parseRoute(hashOf(route)), route);
  const sessions: Route = { map: 'yard', page: 'sessions', epoch: null, from: null, colour: 'height', session: 'day:1' };
  assert.deepEqual(parseRoute(hashOf(sessions)), sessions);
  assert.equal(parseRoute('').map, null);
  assert.equal(parseRoute('#/yard/nonsense?epoch=x&colour=pink').page, 'map');
  assert.equal(parseRoute('#/yard/map?epoch=-1').epoch, null);
  assert.equal(parseRoute('#/%E0%A4%A/map').map, null);
});

test('answers in protobuf JSON become values: 64-bit numbers are strings, zeros are absent', () => {
  const map = mapOf({ name: 'yard', voxelSize: 0.2, epoch: '12', staticVoxels: '4294967296', bounds: { min: { x: -1 }, max: { x: 2, y: 3, z: 4 } } });
  assert.equal(map.epoch, 12);
  assert.equal(map.staticVoxels, 2 ** 32);
  assert.equal(map.sessions, 0);
  assert.deepEqual(map.bounds, { min: [-1, 0, 0], max: [2, 3, 4] });
  assert.equal(epochOf({ epoch: '3', session: 'day-3', readable: true }).kind, 'session');
  assert.equal(epochOf({ epoch: '4', rollback: true, baseEpoch: '2' }).kind, 'rollback');
  assert.equal(epochOf({}).kind, 'empty');
  const session = sessionOf({ id: 'x', state: 'SESSION_STATE_REFUSED', reason: 'too far', report: { windows: [{ fitness: 0.4, lastScan: 29 }] } });
  assert.equal(session.state, 'refused');
  assert.equal(session.report?.windows[0]?.fitness, 0.4);
  assert.equal(session.report?.points, 0);
  const page = positionsOf({ poses: [{ rows: [1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 1, 7] }], scanCount: 3 });
  assert.deepEqual(page, { positions: [[5, 6, 7]], scanCount: 3 });
  assert.equal(sessionOf(null).state, 'unknown');
});

test('a click means the near point, not one behind it, and nothing where there is nothing', () => {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(new Float32Array([0, 0, 0, 0, 10, 0, 5, 0, 0]), 3));
  const tile = new TilePoints(new Points(geometry), new PointMaterial());
  const camera = new PerspectiveCamera(60, 1, 0.1, 100);
  camera.up.set(0, 0, 1);
  camera.position.set(0, -20, 0);
  camera.lookAt(new Vector3(0, 0, 0));
  camera.updateMatrixWorld();
  const matrix = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
  assert.deepEqual(pickPoint([tile], matrix, 200, 200, 400, 400, 8)?.point.toArray(), [0, 0, 0]);
  assert.equal(pickPoint([tile], matrix, 200, 100, 400, 400, 8), null);
  assert.equal(tile.thin(0.34), 1);
  assert.equal(tile.drawnCount, 1);
});

test('the first view shows the whole map and wastes little of the picture', () => {
  for (const [wide, aspect] of [[400, 1.5], [40, 0.5], [3000, 2]] as const) {
    const camera = new PerspectiveCamera(50, aspect, 0.5, 50_000);
    camera.up.set(0, 0, 1);
    const box = new Box3(new Vector3(-wide / 2, -50, -2), new Vector3(wide / 2, 50, 20));
    const direction = new Vector3(-0.35, -0.85, 0.75).normalize();
    const target = box.getCenter(new Vector3());
    const distance = distanceThatShows(camera, target, direction, box, 50_000);
    camera.position.copy(target).addScaledVector(direction, distance);
    camera.updateMatrixWorld();
    let reach = 0;
    for (const x of [box.min.x, box.max.x]) {
      for (const y of [box.min.y, box.max.y]) {
        const p = new Vector3(x, y, box.min.z).project(camera);
        assert.ok(Math.abs(p.x) <= 1 && Math.abs(p.y) <= 1, `${p.x} ${p.y}`);
        reach = Math.max(reach, Math.abs(p.x), Math.abs(p.y));
      }
    }
    assert.ok(reach > 0.6, `the map reaches only ${reach} of the way to the edge`);
  }
});

test('colours run from the first to the last of a ramp, and the picture has those of the legend', () => {
  assert.deepEqual(colourAt(ramps.height, 0), rgbOf(ramps.height[0]!));
  assert.deepEqual(colourAt(ramps.height, 2), rgbOf(ramps.height.at(-1)!));
  const bytes = rampBytes(ramps.stability, 256);
  assert.deepEqual([...bytes.subarray(0, 3)], rgbOf(ramps.stability[0]!).map((c) => Math.round(255 * c)));
});

test('a scan has the fitness of the best window that holds it', () => {
  const window = (firstScan: number, lastScan: number, fitness: number) => ({ firstScan, lastScan, fitness, inliers: 0, correction: 0, trusted: true });
  assert.deepEqual(fitnessOfScans(6, [window(0, 3, 0.7), window(2, 9, 0.9)]), [0.7, 0.7, 0.9, 0.9, 0.9, 0.9]);
  assert.deepEqual(fitnessOfScans(2, []), [-1, -1]);
});

test('a slow machine draws fewer points while the view moves, and all of them at rest', () => {
  const frames = new FrameBudget();
  let most = frames.begin(0, true, 1_000_000);
  for (let i = 1; i <= 8; ++i) {
    frames.end(most);
    most = frames.begin(400 * i, true, 1_000_000); // 400 ms a frame, however few points
  }
  assert.ok(most < 200_000, `${most}`);
  frames.end(most);
  assert.equal(frames.begin(5000, false, 1_000_000), 1_000_000);
});

test('lengths are written in the unit that fits', () => {
  assert.equal(metres(0.123), '12.3 cm');
  assert.equal(metres(12.345), '12.35 m');
  assert.equal(metres(2500), '2.50 km');
  assert.equal(short(1_234_567), '1.23 M');
  assert.equal(scaleBarLength(0.1, 130), 10);
  assert.equal(scaleBarLength(0.5, 130), 50);
  assert.equal(scaleBarLength(0.002, 130), 0.2);
});
