// All parts that are shown as one draw call: each part is a range of one large vertex and index buffer.
import {
  BatchedMesh,
  BufferAttribute,
  BufferGeometry,
  Color,
  MeshBasicMaterial,
  MeshLambertMaterial,
  type Material,
} from 'three';
import { cameraHue } from './camera_color';
import type { PartGeometry } from './preview_decoder';

export type Coloring = 'photo' | 'camera' | 'plain';

const WHITE = new Color(1, 1, 1);
const GROWTH = 1.6;

interface Shown {
  geometry: number;
  instance: number;
  camera: number;
  faces: number;
}

export class PartBatch {
  readonly mesh: BatchedMesh;
  private readonly parts = new Map<number, Shown>();
  private readonly materials: Record<Coloring, Material>;
  private coloring: Coloring = 'photo';
  private maxParts = 256;
  private maxVertices = 1 << 17;
  private maxIndices = 3 << 18;
  private shownFaces = 0;

  constructor() {
    this.materials = {
      // Photographs have their own light.
      photo: new MeshBasicMaterial({ vertexColors: true }),
      camera: new MeshLambertMaterial(),
      plain: new MeshLambertMaterial({ color: 0xd8d4cc }),
    };
    this.mesh = new BatchedMesh(this.maxParts, this.maxVertices, this.maxIndices, this.materials.photo);
    this.mesh.sortObjects = false;
  }

  get faces(): number {
    return this.shownFaces;
  }

  // Adds the part, or replaces it by another level of detail.
  put(sequence: number, camera: number, part: PartGeometry) {
    this.remove(sequence);
    if (part.indices.length === 0) return;
    this.makeRoom(part.positions.length / 3, part.indices.length);
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(part.positions, 3));
    geometry.setAttribute('normal', new BufferAttribute(part.normals, 4, true));
    geometry.setAttribute('color', new BufferAttribute(part.colors, 4, true));
    geometry.setIndex(new BufferAttribute(part.indices, 1));
    const id = this.mesh.addGeometry(geometry);
    const instance = this.mesh.addInstance(id);
    const shown = { geometry: id, instance, camera, faces: part.indices.length / 3 };
    this.paint(shown);
    this.parts.set(sequence, shown);
    this.shownFaces += shown.faces;
  }

  remove(sequence: number) {
    const shown = this.parts.get(sequence);
    if (shown === undefined) return;
    this.mesh.deleteGeometry(shown.geometry);
    this.parts.delete(sequence);
    this.shownFaces -= shown.faces;
  }

  setColoring(coloring: Coloring) {
    this.coloring = coloring;
    this.mesh.material = this.materials[coloring];
    for (const shown of this.parts.values()) this.paint(shown);
  }

  dispose() {
    this.mesh.dispose();
    for (const material of Object.values(this.materials)) material.dispose();
  }

  private paint(shown: Shown) {
    const color = this.coloring === 'camera' ? new Color().setHSL(cameraHue(shown.camera) / 360, 0.62, 0.55) : WHITE;
    this.mesh.setColorAt(shown.instance, color);
  }

  // Ranges of removed parts are reclaimed only when the end of the buffer is reached, and the buffer grows only when
  // that is not enough.
  private makeRoom(vertices: number, indices: number) {
    if (this.parts.size + 1 > this.maxParts) {
      this.maxParts *= 2;
      this.mesh.setInstanceCount(this.maxParts);
    }
    const fits = () => this.mesh.unusedVertexCount >= vertices && this.mesh.unusedIndexCount >= indices;
    if (fits()) return;
    this.mesh.optimize();
    const wantedVertices = this.maxVertices - this.mesh.unusedVertexCount + vertices;
    const wantedIndices = this.maxIndices - this.mesh.unusedIndexCount + indices;
    // Not before a good part is free, or every further part would move everything.
    if (wantedVertices * 1.2 < this.maxVertices && wantedIndices * 1.2 < this.maxIndices) return;
    this.maxVertices = Math.max(this.maxVertices, Math.ceil(wantedVertices * GROWTH));
    this.maxIndices = Math.max(this.maxIndices, Math.ceil(wantedIndices * GROWTH));
    this.mesh.setGeometrySize(this.maxVertices, this.maxIndices);
  }
}
