// SPDX-License-Identifier: Apache-2.0
// A part's preview in the layout of openapi.yaml: the cell of terrain below one camera, every stride-th row and column.
import { color, height } from './terrain.js';

export function makePreview({ sequence, camera, x0, y0, size, rows, maxFaces }) {
  let stride = 1;
  const kept = (step) => Math.ceil((rows - 1) / step) + 1; // the last one always
  const at = (i) => Math.min(i * stride, rows - 1) / (rows - 1);
  while (2 * (kept(stride) - 1) ** 2 > maxFaces) ++stride;
  const side = kept(stride);
  const vertices = side * side;
  const faces = 2 * (side - 1) ** 2;
  const colorsAt = 56 + 12 * vertices;
  const indicesAt = colorsAt + 4 * Math.ceil((3 * vertices) / 4);
  const buffer = Buffer.alloc(indicesAt + 12 * faces);
  buffer.write('MWPV', 0, 'latin1');
  [1, sequence, camera, vertices, faces, stride, 2 * (rows - 1) ** 2].forEach((word, i) =>
    buffer.writeUInt32LE(word, 4 + 4 * i),
  );
  const min = [Infinity, Infinity, Infinity];
  const max = [-Infinity, -Infinity, -Infinity];
  for (let j = 0; j < side; ++j) {
    for (let i = 0; i < side; ++i) {
      const x = x0 + size * at(i);
      const y = y0 + size * at(j);
      const point = [x, y, height(x, y)];
      const vertex = j * side + i;
      color(x, y).forEach((value, k) => buffer.writeUInt8(value, colorsAt + 3 * vertex + k));
      point.forEach((value, k) => {
        buffer.writeFloatLE(value, 56 + 12 * vertex + 4 * k);
        min[k] = Math.min(min[k], value);
        max[k] = Math.max(max[k], value);
      });
    }
  }
  min.forEach((value, k) => buffer.writeFloatLE(value, 32 + 4 * k));
  max.forEach((value, k) => buffer.writeFloatLE(value, 44 + 4 * k));
  let offset = indicesAt;
  for (let j = 0; j + 1 < side; ++j) {
    for (let i = 0; i + 1 < side; ++i) {
      const a = j * side + i;
      for (const corner of [a, a + 1, a + side + 1, a, a + side + 1, a + side])
        offset = buffer.writeUInt32LE(corner, offset);
    }
  }
  return buffer;
}
