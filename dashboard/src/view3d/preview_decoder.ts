// SPDX-License-Identifier: Apache-2.0
// The preview of a part (coordinator/rest/openapi.yaml, previewPart) as buffers for the graphics card.

export interface PartGeometry {
  sequence: number;
  camera: number;
  facesOfWhole: number; // before simplification
  positions: Float32Array<ArrayBuffer>; // 3 per vertex, world frame
  normals: Int8Array<ArrayBuffer>; // 4 per vertex, the last is padding
  colors: Uint8Array<ArrayBuffer>; // RGBA per vertex, sRGB
  indices: Uint32Array<ArrayBuffer>; // 3 per face
  min: [number, number, number];
  max: [number, number, number];
}

const HEADER_BYTES = 56;
const MAGIC = 0x5650574d; // "MWPV", little-endian

// Throws when the bytes are not what the layout says.
export function decodePreview(buffer: ArrayBuffer): PartGeometry {
  if (buffer.byteLength < HEADER_BYTES) throw new Error('a preview is too short');
  const header = new DataView(buffer, 0, HEADER_BYTES);
  const word = (index: number) => header.getUint32(4 * index, true);
  if (word(0) !== MAGIC || word(1) !== 1) throw new Error('a preview has an unknown layout');
  const vertices = word(4);
  const faces = word(5);
  const colorsAt = HEADER_BYTES + 12 * vertices;
  const indicesAt = colorsAt + 4 * Math.ceil((3 * vertices) / 4);
  if (buffer.byteLength !== indicesAt + 12 * faces) throw new Error('a preview is cut off');

  const positions = new Float32Array(buffer.slice(HEADER_BYTES, colorsAt));
  const indices = new Uint32Array(buffer.slice(indicesAt));
  for (const index of indices) if (index >= vertices) throw new Error('a preview has a corner that is not there');
  const rgb = new Uint8Array(buffer, colorsAt, 3 * vertices);
  const colors = new Uint8Array(4 * vertices).fill(255);
  for (let i = 0; i < vertices; ++i) {
    colors[4 * i] = rgb[3 * i]!;
    colors[4 * i + 1] = rgb[3 * i + 1]!;
    colors[4 * i + 2] = rgb[3 * i + 2]!;
  }
  const corner = (offset: number): [number, number, number] => [
    header.getFloat32(offset, true),
    header.getFloat32(offset + 4, true),
    header.getFloat32(offset + 8, true),
  ];
  return {
    sequence: word(2),
    camera: word(3),
    facesOfWhole: word(7),
    positions,
    normals: vertexNormals(positions, indices),
    colors,
    indices,
    min: corner(32),
    max: corner(44),
  };
}

// The mean of the normals of the faces around each vertex, weighted by area.
export function vertexNormals(positions: Float32Array, indices: Uint32Array): Int8Array<ArrayBuffer> {
  const sums = new Float32Array(positions.length);
  for (let i = 0; i < indices.length; i += 3) {
    const a = 3 * indices[i]!;
    const b = 3 * indices[i + 1]!;
    const c = 3 * indices[i + 2]!;
    const ux = positions[b]! - positions[a]!;
    const uy = positions[b + 1]! - positions[a + 1]!;
    const uz = positions[b + 2]! - positions[a + 2]!;
    const vx = positions[c]! - positions[a]!;
    const vy = positions[c + 1]! - positions[a + 1]!;
    const vz = positions[c + 2]! - positions[a + 2]!;
    const x = uy * vz - uz * vy;
    const y = uz * vx - ux * vz;
    const z = ux * vy - uy * vx;
    for (const corner of [a, b, c]) {
      sums[corner]! += x;
      sums[corner + 1]! += y;
      sums[corner + 2]! += z;
    }
  }
  const normals = new Int8Array((positions.length / 3) * 4);
  for (let i = 0; i < positions.length / 3; ++i) {
    const scale = 127 / (Math.hypot(sums[3 * i]!, sums[3 * i + 1]!, sums[3 * i + 2]!) || 1);
    for (let k = 0; k < 3; ++k) normals[4 * i + k] = Math.round(sums[3 * i + k]! * scale);
  }
  return normals;
}
