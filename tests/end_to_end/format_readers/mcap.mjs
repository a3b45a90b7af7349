// mcap.mjs SESSION OUT.mcap COMPRESSION: writes a session in the kitti layout (velodyne/*.bin, poses.txt, times.txt)
// as a ROS 2 recording, with the npm packages @mcap/core and @foxglove/rosmsg2-serialization. COMPRESSION is zstd, lz4,
// none (chunks as they are) or flat (no chunks). The odometry is of base_link, 1.7 m below the sensor.
import {open, readFile, readdir} from 'node:fs/promises';
import {parse} from '@foxglove/rosmsg';
import {MessageWriter} from '@foxglove/rosmsg2-serialization';
import zstd from '@foxglove/wasm-zstd';
import {McapWriter} from '@mcap/core';
import lz4 from 'lz4js';

const [session, out, compression] = process.argv.slice(2);
await zstd.isLoaded;
const compressors = {
  zstd: (data) => ({compression: 'zstd', compressedData: zstd.compress(data, 3)}),
  lz4: (data) => ({compression: 'lz4', compressedData: lz4.compress(data)}),
};

const HEADER = `
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
`;
const POSE = `
================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
`;
const definitions = {
  'sensor_msgs/msg/PointCloud2': `std_msgs/Header header
uint32 height
uint32 width
sensor_msgs/PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense
${HEADER}
================================================================================
MSG: sensor_msgs/PointField
string name
uint32 offset
uint8 datatype
uint32 count
`,
  'nav_msgs/msg/Odometry': `std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
${HEADER}${POSE}
================================================================================
MSG: geometry_msgs/PoseWithCovariance
geometry_msgs/Pose pose
float64[36] covariance
`,
  'tf2_msgs/msg/TFMessage': `geometry_msgs/TransformStamped[] transforms
${HEADER}${POSE}
================================================================================
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
================================================================================
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
`,
  'std_msgs/msg/String': 'string data\n',
};

const file = await open(out, 'w');
let position = 0n;
const writer = new McapWriter({
  writable: {
    write: async (data) => {
      await file.write(data);
      position += BigInt(data.byteLength);
    },
    position: () => position,
  },
  chunkSize: 1 << 20,
  useChunks: compression !== 'flat',
  compressChunk: compressors[compression],
});
await writer.start({profile: 'ros2', library: 'test'});
const channels = {};
for (const [topic, type] of [
  ['/chatter', 'std_msgs/msg/String'], ['/tf_static', 'tf2_msgs/msg/TFMessage'], ['/odom', 'nav_msgs/msg/Odometry'],
  ['/lidar/points', 'sensor_msgs/msg/PointCloud2'],
]) {
  const schemaId = await writer.registerSchema(
      {name: type, encoding: 'ros2msg', data: new TextEncoder().encode(definitions[type])});
  const id = await writer.registerChannel({topic, schemaId, messageEncoding: 'cdr', metadata: new Map()});
  channels[topic] = {id, writer: new MessageWriter(parse(definitions[type], {ros2: true})), sequence: 0};
}
const nanoseconds = (time) => BigInt(Math.round(time * 1e9));
const stampOf = (time) => ({sec: Number(nanoseconds(time) / 1000000000n), nsec: Number(nanoseconds(time) % 1000000000n)});
async function put(topic, time, message) {
  const channel = channels[topic];
  await writer.addMessage({
    channelId: channel.id,
    sequence: channel.sequence++,
    logTime: nanoseconds(time),
    publishTime: nanoseconds(time),
    data: channel.writer.writeMessage(message),
  });
}
const lines = async (name) => (await readFile(`${session}/${name}`, 'utf8')).trim().split('\n');

function quaternionOf(r) {  // of a row-major 3x4
  const w = Math.sqrt(Math.max(0, 1 + r[0] + r[5] + r[10])) / 2;
  const x = Math.sqrt(Math.max(0, 1 + r[0] - r[5] - r[10])) / 2;
  const y = Math.sqrt(Math.max(0, 1 - r[0] + r[5] - r[10])) / 2;
  const z = Math.sqrt(Math.max(0, 1 - r[0] - r[5] + r[10])) / 2;
  return {w, x: Math.sign(r[9] - r[6]) * x, y: Math.sign(r[2] - r[8]) * y, z: Math.sign(r[4] - r[1]) * z};
}

const times = (await lines('times.txt')).map(Number);
const poses = (await lines('poses.txt')).map((line) => line.split(' ').map(Number));
const scans = (await readdir(`${session}/velodyne`)).sort();
await put('/tf_static', times[0], {transforms: [{
  header: {stamp: stampOf(times[0]), frame_id: 'base_link'},
  child_frame_id: 'lidar',
  transform: {translation: {x: 0, y: 0, z: 1.7}, rotation: {x: 0, y: 0, z: 0, w: 1}},
}]});
for (const [i, name] of scans.entries()) {
  const r = poses[i], header = (frame_id) => ({stamp: stampOf(times[i]), frame_id});
  await put('/chatter', times[i], {data: `scan ${i}`});
  const position = {x: r[3] - 1.7 * r[2], y: r[7] - 1.7 * r[6], z: r[11] - 1.7 * r[10]};
  await put('/odom', times[i], {
    header: header('odom'),
    child_frame_id: 'base_link',
    pose: {pose: {position, orientation: quaternionOf(r)}, covariance: new Float64Array(36)},
  });
  const data = new Uint8Array(await readFile(`${session}/velodyne/${name}`));
  const width = data.byteLength / 16;
  const fields = ['x', 'y', 'z', 'intensity'].map((of, k) => ({name: of, offset: 4 * k, datatype: 7, count: 1}));
  await put('/lidar/points', times[i], {
    header: header('lidar'), height: 1, width, fields, is_bigendian: false, point_step: 16, row_step: 16 * width, data,
    is_dense: true,
  });
}
await writer.end();
await file.close();
process.stdout.write(JSON.stringify({scans: scans.length, bytes: Number(position)}));
