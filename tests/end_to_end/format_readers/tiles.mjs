// tiles.mjs FILE.glb | DIRECTORY: what loaders.gl finds in a glTF file, or in all tiles of a tileset, and what
// gltf-validator says of each, as one JSON document. Points in metres in the map's frame, z up.
import {readFileSync, statSync} from 'node:fs';
import {join} from 'node:path';
import {parse} from '@loaders.gl/core';
import {Tiles3DLoader} from '@loaders.gl/3d-tiles';
import {GLTFLoader, postProcessGLTF} from '@loaders.gl/gltf';
import validator from 'gltf-validator';

const path = process.argv[2];
const bytesOf = (file) => {
  const bytes = readFileSync(file);
  return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
};
const result = {files: 0, meshes: 0, points: 0, errors: 0, messages: [], min: [Infinity, Infinity, Infinity],
                max: [-Infinity, -Infinity, -Infinity], attributes: {}, ground: 0};

function rotate([x, y, z], [qx, qy, qz, qw]) {
  const tx = 2 * (qy * z - qz * y), ty = 2 * (qz * x - qx * z), tz = 2 * (qx * y - qy * x);
  return [x + qw * tx + qy * tz - qz * ty, y + qw * ty + qz * tx - qx * tz, z + qw * tz + qx * ty - qy * tx];
}

async function read(file) {
  ++result.files;
  const report = await validator.validateBytes(new Uint8Array(bytesOf(file)), {maxIssues: 5});
  result.errors += report.issues.numErrors;
  result.messages.push(...report.issues.messages.filter((m) => m.severity === 0).map((m) => m.message));
  const gltf = postProcessGLTF(await parse(bytesOf(file), GLTFLoader, {worker: false}));
  for (const node of gltf.scene?.nodes ?? []) {
    ++result.meshes;
    for (const {attributes, mode} of node.mesh.primitives) {
      if (mode !== 0) throw new Error('not points');
      const position = attributes.POSITION, stride = position.value.length / position.count;
      for (const [name, of] of Object.entries(attributes)) {
        if (of.count !== position.count) throw new Error(`${name} has another length`);
        result.attributes[name] = of.value.constructor.name;
      }
      result.points += position.count;
      const ground = attributes._GROUND, step = ground.value.length / ground.count;
      for (let i = 0; i < position.count; ++i) {
        const scaled = [0, 1, 2].map((axis) => position.value[i * stride + axis] * (node.scale?.[axis] ?? 1));
        const [x, y, z] = rotate(scaled, node.rotation ?? [0, 0, 0, 1]).map((c, axis) => c + node.translation[axis]);
        [x, -z, y].forEach((c, axis) => {
          result.min[axis] = Math.min(result.min[axis], c);
          result.max[axis] = Math.max(result.max[axis], c);
        });
        result.ground += ground.value[i * step];
      }
    }
  }
}

if (statSync(path).isDirectory()) {
  const file = join(path, 'tileset.json');
  const tileset = await parse(bytesOf(file), Tiles3DLoader, {worker: false, '3d-tiles': {isTileset: true}}, file);
  result.version = tileset.asset.version;
  const visit = async (tile) => {
    const uri = tile.content?.uri ?? tile.content?.url;
    if (uri) await read(join(path, uri));
    for (const child of tile.children ?? []) await visit(child);
  };
  await visit(JSON.parse(readFileSync(file)).root);
  result.geometricError = tileset.root.lodMetricValue ?? tileset.root.geometricError;
} else {
  await read(path);
}
process.stdout.write(JSON.stringify(result));
