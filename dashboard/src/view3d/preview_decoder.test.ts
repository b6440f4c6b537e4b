// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';
import { decodePreview } from './preview_decoder';

// Two triangles of a square in z = 1, counter-clockwise seen from above.
function square(): ArrayBuffer {
  const vertices = 4;
  const buffer = new ArrayBuffer(56 + 12 * vertices + 12 + 12 * 2);
  const view = new DataView(buffer);
  new Uint8Array(buffer).set(new TextEncoder().encode('MWPV'));
  [1, 7, 3, vertices, 2, 4, 900].forEach((word, i) => view.setUint32(4 + 4 * i, word, true));
  [0, 0, 1, 2, 2, 1].forEach((x, i) => view.setFloat32(32 + 4 * i, x, true));
  [0, 0, 1, 2, 0, 1, 2, 2, 1, 0, 2, 1].forEach((x, i) => view.setFloat32(56 + 4 * i, x, true));
  for (let i = 0; i < 12; ++i) view.setUint8(56 + 48 + i, 10 * i);
  [0, 1, 2, 0, 2, 3].forEach((corner, i) => view.setUint32(56 + 48 + 12 + 4 * i, corner, true));
  return buffer;
}

describe('decodePreview', () => {
  it('reads what the layout says', () => {
    const part = decodePreview(square());
    expect(part).toMatchObject({ sequence: 7, camera: 3, facesOfWhole: 900, min: [0, 0, 1], max: [2, 2, 1] });
    expect([...part.positions.slice(3, 6)]).toEqual([2, 0, 1]);
    expect([...part.colors.slice(4, 8)]).toEqual([30, 40, 50, 255]);
    expect([...part.indices]).toEqual([0, 1, 2, 0, 2, 3]);
    for (let i = 0; i < 4; ++i) expect([...part.normals.slice(4 * i, 4 * i + 3)]).toEqual([0, 0, 127]);
  });

  it('refuses every cut, a foreign magic, an unknown version and corners that are not there', () => {
    const whole = square();
    for (let bytes = 0; bytes < whole.byteLength; ++bytes) expect(() => decodePreview(whole.slice(0, bytes))).toThrow();
    for (const [offset, value] of [
      [0, 0x12345678],
      [4, 2],
      [56 + 48 + 12, 4],
    ] as const) {
      const broken = whole.slice(0);
      new DataView(broken).setUint32(offset, value, true);
      expect(() => decodePreview(broken)).toThrow();
    }
  });
});
