// SPDX-License-Identifier: Apache-2.0
// All parts that are shown as one draw call: each is a range of one vertex and one index buffer. A part that goes leaves
// triangles without area behind, until the buffers are full and what is left moves together.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DynamicDrawUsage,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  type Material,
} from 'three';
import { cameraHue } from './camera_color';
import type { PartGeometry } from './preview_decoder';

export type Coloring = 'photo' | 'camera' | 'plain';

interface Range {
  camera: number;
  vertexStart: number;
  vertices: number;
  indexStart: number;
  indices: number;
}

const GROWTH = 1.6;

export class PartBuffer {
  readonly mesh: Mesh<BufferGeometry, Material>;
  private readonly materials: Record<Coloring, Material>;
  private readonly ranges = new Map<number, Range>(); // by sequence
  private capacity = { vertices: 1 << 16, indices: 3 << 17 };
  private used = { vertices: 0, indices: 0 }; // up to the end of the last range
  private live = { vertices: 0, indices: 0 }; // in ranges
  private coloring: Coloring = 'photo';
  private photoColors: BufferAttribute;
  private cameraColors: BufferAttribute;

  constructor() {
    this.materials = {
      // Photographs have their own light.
      photo: new MeshBasicMaterial({ vertexColors: true }),
      camera: new MeshLambertMaterial({ vertexColors: true }),
      plain: new MeshLambertMaterial({ color: 0xd8d4cc }),
    };
    this.mesh = new Mesh(new BufferGeometry(), this.materials.photo);
    this.mesh.frustumCulled = false;
    [this.photoColors, this.cameraColors] = this.allocate();
    this.setColoring('photo');
  }

  get faces(): number {
    return this.live.indices / 3;
  }

  // Adds the part, or replaces it by another level of detail.
  put(sequence: number, camera: number, part: PartGeometry) {
    this.remove(sequence);
    const [vertices, indices] = [part.positions.length / 3, part.indices.length];
    if (indices === 0) return;
    this.makeRoom(vertices, indices);
    const range = { camera, vertexStart: this.used.vertices, vertices, indexStart: this.used.indices, indices };
    const { position, normal } = this.attributes();
    write(position, part.positions, range.vertexStart);
    write(normal, part.normals, range.vertexStart);
    write(this.photoColors, part.colors, range.vertexStart);
    write(this.cameraColors, repeated(colorOf(camera), vertices), range.vertexStart);
    write(
      this.index(),
      part.indices.map((index) => index + range.vertexStart),
      range.indexStart,
    );
    this.ranges.set(sequence, range);
    this.used.vertices += vertices;
    this.used.indices += indices;
    this.live.vertices += vertices;
    this.live.indices += indices;
    this.mesh.geometry.setDrawRange(0, this.used.indices);
  }

  remove(sequence: number) {
    const range = this.ranges.get(sequence);
    if (range === undefined) return;
    this.ranges.delete(sequence);
    this.live.vertices -= range.vertices;
    this.live.indices -= range.indices;
    write(this.index(), new Uint32Array(range.indices), range.indexStart);
  }

  setColoring(coloring: Coloring) {
    this.coloring = coloring;
    this.mesh.material = this.materials[coloring];
    this.mesh.geometry.setAttribute('color', coloring === 'camera' ? this.cameraColors : this.photoColors);
  }

  dispose() {
    this.mesh.geometry.dispose();
    for (const material of Object.values(this.materials)) material.dispose();
  }

  private attributes() {
    const { position, normal } = this.mesh.geometry.attributes as Record<string, BufferAttribute>;
    return { position: position!, normal: normal! };
  }

  private index(): BufferAttribute {
    return this.mesh.geometry.index!;
  }

  private allocate(): [BufferAttribute, BufferAttribute] {
    const { vertices, indices } = this.capacity;
    const dynamic = (attribute: BufferAttribute) => attribute.setUsage(DynamicDrawUsage);
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', dynamic(new BufferAttribute(new Float32Array(3 * vertices), 3)));
    geometry.setAttribute('normal', dynamic(new BufferAttribute(new Int8Array(4 * vertices), 4, true)));
    geometry.setIndex(dynamic(new BufferAttribute(new Uint32Array(indices), 1)));
    this.mesh.geometry.dispose();
    this.mesh.geometry = geometry;
    const colors = () => dynamic(new BufferAttribute(new Uint8Array(4 * vertices), 4, true));
    return [(this.photoColors = colors()), (this.cameraColors = colors())];
  }

  private makeRoom(vertices: number, indices: number) {
    const { used, live, capacity } = this;
    if (used.vertices + vertices <= capacity.vertices && used.indices + indices <= capacity.indices) return;
    // A good part has to be free afterwards, or every further part would move everything.
    capacity.vertices = Math.max(capacity.vertices, Math.ceil((live.vertices + vertices) * GROWTH));
    capacity.indices = Math.max(capacity.indices, Math.ceil((live.indices + indices) * GROWTH));
    const before = { ...this.attributes(), photo: this.photoColors, camera: this.cameraColors, index: this.index() };
    this.allocate();
    const now = { ...this.attributes(), photo: this.photoColors, camera: this.cameraColors, index: this.index() };
    used.vertices = 0;
    used.indices = 0;
    for (const range of this.ranges.values()) {
      for (const name of ['position', 'normal', 'photo', 'camera'] as const) {
        const { itemSize, array } = before[name];
        const from = range.vertexStart * itemSize;
        now[name].array.set(array.subarray(from, from + range.vertices * itemSize), used.vertices * itemSize);
      }
      const shift = used.vertices - range.vertexStart;
      for (let i = 0; i < range.indices; ++i) {
        now.index.array[used.indices + i] = before.index.array[range.indexStart + i]! + shift;
      }
      range.vertexStart = used.vertices;
      range.indexStart = used.indices;
      used.vertices += range.vertices;
      used.indices += range.indices;
    }
    this.setColoring(this.coloring);
  }
}

function write(attribute: BufferAttribute, values: ArrayLike<number>, start: number) {
  attribute.array.set(values, start * attribute.itemSize);
  attribute.addUpdateRange(start * attribute.itemSize, values.length);
  attribute.needsUpdate = true;
}

function colorOf(camera: number): [number, number, number, number] {
  const { r, g, b } = new Color().setHSL(cameraHue(camera) / 360, 0.62, 0.55);
  return [Math.round(255 * r), Math.round(255 * g), Math.round(255 * b), 255];
}

function repeated(color: readonly number[], times: number): Uint8Array {
  const colors = new Uint8Array(4 * times);
  for (let i = 0; i < times; ++i) colors.set(color, 4 * i);
  return colors;
}
