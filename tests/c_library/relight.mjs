// Relights by the C library in WebAssembly: node relight.mjs LIBRARY.wasm ATLAS SCENE.json says hashes of what comes out.

import { readFileSync } from "node:fs";

const [library, atlasFile, sceneFile] = process.argv.slice(2);
const module = new WebAssembly.Module(readFileSync(library));
const imports = WebAssembly.Module.imports(module);
if (imports.length > 0) throw new Error(`it imports ${JSON.stringify(imports)}`);
const relume = new WebAssembly.Instance(module).exports;
const scene = JSON.parse(readFileSync(sceneFile, "utf8"));
const bytes = readFileSync(atlasFile);

// Memory is the caller's: what is behind the library's own, handed out once.
let end = relume.__heap_base.value;
function take(size) {
  const start = (end + 7) & ~7;
  end = start + size;
  const missing = end - relume.memory.buffer.byteLength;
  if (missing > 0) relume.memory.grow(Math.ceil(missing / 65536));
  return start;
}
function put(values, Type) {
  const start = take(values.length * Type.BYTES_PER_ELEMENT);
  new Type(relume.memory.buffer, start, values.length).set(values);
  return start;
}
function must(status) {
  if (status !== 0) throw new Error(`status ${status}`);
}

// FNV-1a, 32 bits.
function hash(start, length) {
  let sum = 0x811c9dc5;
  for (const byte of new Uint8Array(relume.memory.buffer, start, length)) sum = Math.imul(sum ^ byte, 0x01000193);
  return sum >>> 0;
}

const atlas = take(248);
must(relume.relume_atlas_parse(put(bytes, Uint8Array), bytes.length, atlas));
const info = take(24);
must(relume.relume_atlas_info(atlas, info));
const [elements, lights, , , , room] = new Uint32Array(relume.memory.buffer, info, 6);

const full = put(scene.full.flat(), Float32Array);
const frame = take(392);
must(relume.relume_frame_make(atlas, full, lights, take(room), room, frame));
const [first, second] = scene.levels.map((levels) => put(levels.flat(), Uint16Array));
const light = (levels, number) => levels + 6 * number;

// A run is a word and three halves, and two bytes that are nothing.
const runs = put(scene.runs.flatMap(([count, [r, g, b]]) => [count, r | (g << 16), b]), Uint32Array);
const finish = put([runs, scene.runs.length, 0], Uint32Array);
new Float32Array(relume.memory.buffer, finish + 8, 1)[0] = scene.exposure;
const pixels = take(3 * elements);
function show(name) {
  must(relume.relume_frame_rgb565(frame, finish, relume.relume_rgb565_bright.value, pixels, elements));
  console.log(`${name} ${hash(pixels, 2 * elements)}`);
}

must(relume.relume_frame_full(frame, second, lights));
show("full_565");
must(relume.relume_frame_full(frame, second, lights));
show("again_565");
must(relume.relume_frame_rgb888(frame, finish, relume.relume_rgb888_bright.value, pixels, elements));
console.log(`full_888 ${hash(pixels, 3 * elements)}`);
must(relume.relume_frame_full(frame, first, lights));
must(relume.relume_frame_change(frame, scene.changed, light(second, scene.changed)));
show("change_565");
must(relume.relume_frame_change(frame, scene.changed, light(first, scene.changed)));
show("undone_565");

const [scratch, sums, unit] = [take(4 * 24 * lights), take(12 * elements), take(4)];
must(relume.relume_irradiance(atlas, full, full, lights, scratch, 24 * lights, sums, elements, unit));
console.log(`irradiance ${hash(sums, 12 * elements)}\nunit ${hash(unit, 4)}`);
if (relume.relume_atlas_parse(0, 1, atlas) !== 1) throw new Error("null is not refused");
