// node detect.mjs MODEL_DIR RAW COUNT: raw 512x512x3 uint8 pictures -> a JSON line each: [[label, score, x0, y0, x1, y1], ...]
import fs from 'node:fs';
import path from 'node:path';
import { createRequire } from 'node:module';
const require = createRequire(import.meta.url);
const tf = require('@tensorflow/tfjs-core');
const { loadGraphModel } = require('@tensorflow/tfjs-converter');
const wasm = require('@tensorflow/tfjs-backend-wasm');
require('@tensorflow/tfjs-backend-cpu');
const [dir, raw, count] = process.argv.slice(2);
wasm.setWasmPaths(path.dirname(require.resolve('@tensorflow/tfjs-backend-wasm')) + '/');
await tf.setBackend(process.env.BACKEND || 'wasm');
const spec = JSON.parse(fs.readFileSync(path.join(dir, 'centernet.json')));
const bin = fs.readFileSync(path.join(dir, 'centernet.bin'));
const model = await loadGraphModel({ load: async () => ({
  modelTopology: spec.modelTopology, signature: spec.signature, weightSpecs: spec.weightsManifest[0].weights,
  weightData: bin.buffer.slice(bin.byteOffset, bin.byteOffset + bin.length) }) });
const side = 512, size = side * side * 3, fd = fs.openSync(raw, 'r');
for (let k = 0; k < Number(count); k++) {
  const pixels = new Uint8Array(size);
  fs.readSync(fd, pixels, 0, size, k * size);
  const input = tf.tensor4d(Float32Array.from(pixels), [1, side, side, 3]);
  const out = model.execute(input, ['tower_0/detections']);
  const rows = (await out.array())[0].filter((row) => row[4] > 0.1);
  console.log(JSON.stringify(rows));
  tf.dispose([input, out]);
}
