// A robot that knows Mapkeep by its protos alone: uploads a session directory in KITTI's layout, commits it, waits, and
// keeps the map's tiles. node robot.mjs PROTO_FOLDER SERVER MAP SESSION_DIRECTORY ID
// Prints one JSON document; what goes wrong is an exception.

import fs from 'node:fs';
import path from 'node:path';
import grpc from '@grpc/grpc-js';
import protoLoader from '@grpc/proto-loader';

const [protos, server, map, directory, id] = process.argv.slice(2);

function client(file, service) {
  const definition = protoLoader.loadSync(`mapkeep/v1/${file}.proto`, {
    includeDirs: [protos], keepCase: true, longs: Number, enums: String, defaults: true, oneofs: true,
  });
  const Service = grpc.loadPackageDefinition(definition).mapkeep.v1[service];
  return new Service(server, grpc.credentials.createInsecure(), {'grpc.max_receive_message_length': 64 << 20});
}

const call = (stub, method, request) => new Promise((resolve, reject) => {
  stub[method](request, {deadline: Date.now() + 120_000}, (error, response) => error ? reject(error) : resolve(response));
});

const TABLE = Array.from({length: 256}, (_, n) => {
  for (let k = 0; k < 8; ++k) n = n & 1 ? (n >>> 1) ^ 0x82f63b78 : n >>> 1;
  return n >>> 0;
});

function crc32c(bytes) {
  let crc = 0xffffffff;
  for (const byte of bytes) crc = TABLE[(crc ^ byte) & 255] ^ (crc >>> 8);
  return (crc ^ 0xffffffff) >>> 0;
}

function readSession() {
  const names = fs.readdirSync(path.join(directory, 'velodyne')).sort((a, b) => parseInt(a) - parseInt(b));
  const rows = fs.readFileSync(path.join(directory, 'poses.txt'), 'utf8').trim().split('\n')
      .map(line => line.trim().split(/\s+/).map(Number));
  const times = fs.readFileSync(path.join(directory, 'times.txt'), 'utf8').trim().split('\n').map(Number);
  return names.map((name, index) => {
    const payload = fs.readFileSync(path.join(directory, 'velodyne', name));
    const numbers = Buffer.alloc(13 * 8);
    [...rows[index], times[index]].forEach((number, at) => numbers.writeDoubleLE(number, 8 * at));
    return {
      header: {
        index, point_count: payload.length / 16, pose: {rows: rows[index]}, time: times[index],
        crc32c: crc32c(Buffer.concat([payload, numbers])),
      },
      payload,
    };
  });
}

function upload(sessions, scans, durable) {
  return new Promise((resolve, reject) => {
    const stream = sessions.UploadScans();
    const acknowledged = [];
    stream.on('data', answer => acknowledged.push(answer.durable_scans));
    stream.on('error', reject);
    stream.on('end', () => resolve(acknowledged));
    stream.write({open: {map, id}});
    for (const {header, payload} of scans.slice(durable)) {
      stream.write({scan: header});
      for (let at = 0; at < payload.length; at += 1 << 20) stream.write({chunk: payload.subarray(at, at + (1 << 20))});
    }
    stream.end();
  });
}

function watched(sessions) {
  return new Promise((resolve, reject) => {
    let last = null;
    const stream = sessions.WatchSession({map, id});
    stream.on('data', answer => last = answer.session);
    stream.on('error', reject);
    stream.on('end', () => resolve(last));
  });
}

function synced(tiles, held) {
  return new Promise((resolve, reject) => {
    const result = {header: null, tiles: []};
    const stream = tiles.SyncTiles({map, held, detail: 'TILE_DETAIL_SUB_VOXELS'});
    stream.on('data', answer => answer.header ? result.header = answer.header : result.tiles.push(answer.tile));
    stream.on('error', reject);
    stream.on('end', () => resolve(result));
  });
}

// The mean points of a tile, as its proto says.
function pointsOf(tile) {
  return tile.layers.map((layer, n) => {
    const voxel = [128 * tile.id.x + tile.columns[2 * n], 128 * tile.id.y + tile.columns[2 * n + 1], layer];
    return voxel.map((index, axis) => (index + (tile.means[3 * n + axis] + 0.5) / 256) * tile.voxel_size);
  });
}

const maps = client('map_service', 'MapService');
const sessions = client('session_service', 'SessionService');
const tiles = client('tile_service', 'TileService');

await call(maps, 'CreateMap', {name: map});
const scans = readSession();
const begun = await call(sessions, 'BeginSession',
                         {map, id, robot: 'node', scan_crc32c: scans.map(scan => scan.header.crc32c)});
const acknowledged = await upload(sessions, scans, begun.session.durable_scans);
await call(sessions, 'CommitSession', {map, id});
const session = await watched(sessions);
const first = await synced(tiles, []);
const again = await synced(tiles, first.tiles.map(tile => ({id: tile.id, version: tile.version})));
const listed = await call(tiles, 'ListTiles', {map, detail: 'TILE_DETAIL_SUB_VOXELS'});
const wrong = await call(sessions, 'GetSession', {map, id: 'none'}).then(() => 'found', error => grpc.status[error.code]);

const said = JSON.stringify({
  scans: scans.length,
  acknowledged,
  state: session.state,
  reason: session.reason,
  epoch: first.header.epoch,
  tiles: first.tiles.length,
  listed: listed.tiles.length,
  again: again.tiles.length + again.header.dropped.length,
  wrong,
  points: first.tiles.flatMap(pointsOf),
});
process.stdout.write(said, () => process.exit(0));
