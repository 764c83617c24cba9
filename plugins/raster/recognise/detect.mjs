// node detect.mjs: raw 512x512x3 uint8 pictures on its input, a JSON line each: [[x0, y0, x1, y1, score, name], ...]
import fs from 'node:fs';
import path from 'node:path';
import { createRequire } from 'node:module';
import { fileURLToPath } from 'node:url';
const require = createRequire(import.meta.url);
const tf = require('@tensorflow/tfjs-core');
const { loadGraphModel } = require('@tensorflow/tfjs-converter');
const wasm = require('@tensorflow/tfjs-backend-wasm');
require('@tensorflow/tfjs-backend-cpu');
// COCO's numbers of what a target can be; everything else keeps its number.
const names = { 56: 'chair', 57: 'couch', 58: 'potted plant', 59: 'bed', 61: 'toilet', 62: 'tv' };
const dir = path.join(path.dirname(fileURLToPath(import.meta.url)), 'node_modules/@vladmandic/human/models');
wasm.setWasmPaths(path.dirname(require.resolve('@tensorflow/tfjs-backend-wasm')) + '/');
await tf.setBackend(process.env.BACKEND || 'wasm');
const spec = JSON.parse(fs.readFileSync(path.join(dir, 'centernet.json')));
const bin = fs.readFileSync(path.join(dir, 'centernet.bin'));
const model = await loadGraphModel({ load: async () => ({
  modelTopology: spec.modelTopology, signature: spec.signature, weightSpecs: spec.weightsManifest[0].weights,
  weightData: bin.buffer.slice(bin.byteOffset, bin.byteOffset + bin.length) }) });
const side = 512, size = side * side * 3, pixels = Buffer.alloc(size);
let filled = 0;
for await (const chunk of process.stdin) {
  for (let read = 0; read < chunk.length;) {
    const taken = chunk.copy(pixels, filled, read, Math.min(chunk.length, read + size - filled));
    filled += taken;
    read += taken;
    if (filled < size) continue;
    filled = 0;
    const input = tf.tensor4d(Float32Array.from(pixels), [1, side, side, 3]);
    const out = model.execute(input, ['tower_0/detections']);
    const rows = (await out.array())[0].filter((row) => row[4] > 0.1);
    console.log(JSON.stringify(rows.map((row) => [...row.slice(0, 5), names[row[5]] ?? String(row[5])])));
    tf.dispose([input, out]);
  }
}
