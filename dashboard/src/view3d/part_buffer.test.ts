// SPDX-License-Identifier: Apache-2.0
import { Color } from 'three';
import { describe, expect, it } from 'vitest';
import { PartBuffer } from './part_buffer';
import type { PartGeometry } from './preview_decoder';

// A strip of `faces` triangles whose positions tell which part they are of.
function strip(sequence: number, faces: number): PartGeometry {
  const vertices = faces + 2;
  const positions = new Float32Array(3 * vertices);
  for (let i = 0; i < vertices; ++i) positions.set([sequence, i, 0], 3 * i);
  const indices = new Uint32Array(3 * faces);
  for (let i = 0; i < faces; ++i) indices.set([i, i + 1, i + 2], 3 * i);
  return {
    sequence,
    camera: sequence,
    facesOfWhole: faces,
    positions,
    normals: new Int8Array(4 * vertices),
    colors: new Uint8Array(4 * vertices).fill(sequence & 255),
    indices,
    min: [0, 0, 0],
    max: [0, 0, 0],
  };
}

// What the graphics card would draw: triangles per part, none with corners of two parts.
function drawn(buffer: PartBuffer): Map<number, number> {
  const { index, attributes, drawRange } = buffer.mesh.geometry;
  const found = new Map<number, number>();
  for (let i = 0; i < drawRange.count; i += 3) {
    const corners = [0, 1, 2].map((k) => index!.getX(i + k));
    if (corners[0] === corners[1]) continue;
    const [part, ...others] = corners.map((corner) => attributes.position!.getX(corner));
    if (others.some((other) => other !== part)) throw new Error(`triangle ${i / 3} joins two parts`);
    found.set(part!, (found.get(part!) ?? 0) + 1);
  }
  return found;
}

describe('PartBuffer', () => {
  it('draws exactly what was put and not removed, however often it has to move or grow', () => {
    const buffer = new PartBuffer();
    const expected = new Map<number, number>();
    let state = 1;
    const next = (below: number) => {
      state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
      return Math.floor((state / 2 ** 32) * below);
    };
    for (let step = 0; step < 300; ++step) {
      const sequence = 1 + next(80);
      if (next(4) === 0) {
        buffer.remove(sequence);
        expected.delete(sequence);
      } else {
        const faces = next(3000);
        buffer.put(sequence, sequence, strip(sequence, faces));
        if (faces > 0) expected.set(sequence, faces);
        else expected.delete(sequence);
      }
      if (step % 50 === 49) expect(new Map([...drawn(buffer)].sort())).toEqual(new Map([...expected].sort()));
      expect(buffer.faces).toBe([...expected.values()].reduce((sum, faces) => sum + faces, 0));
    }
  });

  it('gives vertices the colour that is asked for', () => {
    const buffer = new PartBuffer();
    buffer.put(7, 7, strip(7, 3));
    const color = () => buffer.mesh.geometry.attributes.color!;
    buffer.setColoring('photo');
    expect(color().getX(0)).toBeCloseTo(7 / 255);
    buffer.setColoring('camera');
    const seen = new Color(color().getX(0), color().getY(0), color().getZ(0)).getHSL({ h: 0, s: 0, l: 0 });
    expect(seen.s).toBeGreaterThan(0.4);
  });
});
