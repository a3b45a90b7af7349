// tiles3d.mjs TILESET_URL_OR_FILE FOLDER: reads a tileset with software that nobody here wrote, and prints as JSON what
// each reader found: points and their bounds. FOLDER gets a copy of everything that came over HTTP.

import fs from 'node:fs';
import path from 'node:path';
import { createRequire } from 'node:module';
import { fileURLToPath, pathToFileURL } from 'node:url';
import Ajv from 'ajv';
import validator from 'gltf-validator';
import { parse } from '@loaders.gl/core';
import { Tiles3DLoader } from '@loaders.gl/3d-tiles';
import { GLTFLoader, postProcessGLTF } from '@loaders.gl/gltf';

const require = createRequire(import.meta.url);
const tools = require('3d-tiles-tools');
const here = path.dirname(fileURLToPath(import.meta.url));
const schema = JSON.parse(fs.readFileSync(path.join(here, 'tileset_1_1.schema.json'), 'utf8'));
const fitsSchema = new Ajv({ allErrors: true, strict: false }).compile(schema);

const [address, folder] = process.argv.slice(2);
const root = /^https?:/.test(address) ? new URL(address) : pathToFileURL(path.resolve(address));
const problems = [];

class Bounds {
  points = 0;
  min = [Infinity, Infinity, Infinity];
  max = [-Infinity, -Infinity, -Infinity];
  add(point) {
    ++this.points;
    for (let i = 0; i < 3; ++i) {
      this.min[i] = Math.min(this.min[i], point[i]);
      this.max[i] = Math.max(this.max[i], point[i]);
    }
  }
  json = () => ({ points: this.points, min: this.min, max: this.max });
}

async function read(url) {
  if (url.protocol === 'file:') return new Uint8Array(fs.readFileSync(url));
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url}: ${response.status} ${await response.text()}`);
  return new Uint8Array(await response.arrayBuffer());
}

// The y of glTF is the z of 3D Tiles.
const zUp = ([x, y, z]) => [x, -z, y];

function rotate([x, y, z, w], [px, py, pz]) {
  const tx = 2 * (y * pz - z * py), ty = 2 * (z * px - x * pz), tz = 2 * (x * py - y * px);
  return [px + w * tx + y * tz - z * ty, py + w * ty + z * tx - x * tz, pz + w * tz + x * ty - y * tx];
}

const found = { tiles: 0, tilesets: 0, validator: new Bounds(), loaders: new Bounds(), attributes: {} };

async function validate(bytes, name) {
  const report = await validator.validateBytes(bytes, { uri: name, maxIssues: 20 });
  const { numErrors, numWarnings, messages } = report.issues;
  if (numErrors + numWarnings > 0) problems.push({ name, messages });
  found.validator.points += report.info.totalVertexCount ?? 0;
}

async function readByLoaders(bytes) {
  const gltf = postProcessGLTF(await parse(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength), GLTFLoader));
  for (const node of gltf.scene?.nodes ?? []) {
    for (const { attributes } of node.mesh.primitives) {
      const { value } = attributes.POSITION;
      for (const [name, attribute] of Object.entries(attributes)) {
        found.attributes[name] = (found.attributes[name] ?? 0) + attribute.count;
      }
      for (let i = 0; i < value.length; i += 3) {
        const scaled = [value[i] * node.scale[0], value[i + 1] * node.scale[1], value[i + 2] * node.scale[2]];
        const turned = rotate(node.rotation, scaled);
        found.loaders.add(zUp(turned.map((v, k) => v + node.translation[k])));
      }
    }
  }
}

const inside = (inner, outer) =>
  [0, 1, 2].every((i) => Math.abs(inner[i] - outer[i]) + inner[3 + 4 * i] <= outer[3 + 4 * i] + 1e-6);

async function walkTile(tile, base, parent) {
  if (parent) {
    if (tile.geometricError > parent.geometricError) problems.push({ name: String(base), message: 'error grows downwards' });
    if (!inside(tile.boundingVolume.box, parent.boundingVolume.box)) problems.push({ name: String(base), message: 'a child outside its parent' });
  }
  if (tile.content) {
    const url = new URL(tile.content.uri, base);
    if (url.pathname.endsWith('.json')) {
      await walkTileset(url, tile);
    } else {
      const bytes = await read(url);
      keep(url, bytes);
      ++found.tiles;
      await validate(bytes, url.pathname);
      await readByLoaders(bytes);
    }
  }
  for (const child of tile.children ?? []) await walkTile(child, base, tile);
}

async function walkTileset(url, parent) {
  const bytes = await read(url);
  keep(url, bytes);
  ++found.tilesets;
  const tileset = JSON.parse(new TextDecoder().decode(bytes));
  if (!fitsSchema(tileset)) problems.push({ name: url.pathname, messages: fitsSchema.errors });
  await walkTile(tileset.root, url, parent);
}

// The copy keeps how files lie to each other.
function keep(url, bytes) {
  const below = path.relative(path.dirname(root.pathname), url.pathname);
  const file = path.join(folder, 'copy', 'epoch', 'here', below);
  fs.mkdirSync(path.dirname(file), { recursive: true });
  fs.writeFileSync(file, bytes);
  return file;
}

async function readByTools(file) {
  const seen = { tiles: 0, points: 0 };
  const bounds = new Bounds();
  // The glTF library that 3d-tiles-tools is built on.
  const beside = { paths: [require.resolve('3d-tiles-tools')] };
  const core = require(require.resolve('@gltf-transform/core', beside));
  const extensions = require(require.resolve('@gltf-transform/extensions', beside));
  const io = new core.NodeIO().registerExtensions([extensions.KHRMeshQuantization, extensions.KHRMaterialsUnlit]);
  const resolver = tools.ResourceResolvers.createFileResourceResolver(path.dirname(file));
  const tileset = JSON.parse(fs.readFileSync(file, 'utf8'));
  const traverser = new tools.TilesetTraverser(path.dirname(file), resolver, { depthFirst: true, traverseExternalTilesets: true });
  await traverser.traverse(tileset, async (traversed) => {
    for (const content of traversed.getRawContents()) {
      if (content.uri.endsWith('.json')) continue;
      ++seen.tiles;
      const data = await traversed.getResourceResolver().resolveData(content.uri);
      const document = await io.readBinary(new Uint8Array(data));
      for (const node of document.getRoot().listNodes()) {
        const primitive = node.getMesh().listPrimitives()[0];
        seen.points += primitive.getAttribute('POSITION').getCount();
      }
      for (const scene of document.getRoot().listScenes()) {
        const box = core.getBounds(scene);
        if (!box.min.every(Number.isFinite)) continue;
        bounds.add(zUp(box.min));
        bounds.add(zUp(box.max));
      }
    }
    return true;
  });
  return { ...seen, min: bounds.min, max: bounds.max };
}

await walkTileset(root);
const top = path.join(folder, 'copy', 'epoch', 'here', path.basename(root.pathname));
const withTools = await readByTools(top);
// The header is read as a tileset by loaders.gl, too.
const opened = await parse(await read(root).then((b) => b.buffer), Tiles3DLoader, { '3d-tiles': { isTileset: true } });
console.log(
  JSON.stringify({
    problems,
    tiles: found.tiles,
    tilesets: found.tilesets,
    attributes: found.attributes,
    validatorPoints: found.validator.points,
    loaders: found.loaders.json(),
    loadersVersion: opened.asset?.version,
    tools: withTools,
  }),
);
