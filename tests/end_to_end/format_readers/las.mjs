// las.mjs FILE: what the npm packages copc and @loaders.gl/las read from a LAS file, as one JSON document.
import {readFileSync} from 'node:fs';
import {load} from '@loaders.gl/core';
import {LAZRsLoader} from '@loaders.gl/las';
import {Getter, Las} from 'copc';

// The loader fetches its own WebAssembly, which Node's fetch does not find in files.
const fetchFromNet = globalThis.fetch;
globalThis.fetch = async (url, ...rest) =>
    `${url}`.startsWith('file:')
        ? new Response(readFileSync(new URL(url)), {headers: {'content-type': 'application/wasm'}})
        : fetchFromNet(url, ...rest);

const path = process.argv[2];
const bytes = readFileSync(path);
const get = Getter.create(path);
const header = Las.Header.parse(bytes.subarray(0, Las.Constants.maxHeaderLength ?? 375));
const vlrs = await Las.Vlr.walk(get, header);
const text = async (vlr) => vlr && new TextDecoder().decode(await Las.Vlr.fetch(get, vlr));
const extra = Las.Vlr.find(vlrs, 'LASF_Spec', 4);
const extraBytes = extra ? Las.ExtraBytes.parse(await Las.Vlr.fetch(get, extra)) : [];
const view = Las.View.create(bytes.subarray(header.pointDataOffset), header, extraBytes);
const column = (name) => {
  const of = view.getter(name);
  return Array.from({length: view.pointCount}, (_, i) => of(i));
};

const loaded = await load(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength), LAZRsLoader,
                          {worker: false, las: {fp64: true}});
const positions = loaded.attributes.POSITION.value;
process.stdout.write(JSON.stringify({
  header,
  wkt: await text(Las.Vlr.find(vlrs, 'LASF_Projection', 2112)),
  columns: Object.fromEntries(
      ['X', 'Y', 'Z', 'Intensity', 'Classification', 'GpsTime', 'ReturnNumber', 'NumberOfReturns', 'stability'].map(
          (name) => [name, column(name)])),
  loaders: {count: positions.length / 3, positions: Array.from(positions)},
}));
