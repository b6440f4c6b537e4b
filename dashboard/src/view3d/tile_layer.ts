// SPDX-License-Identifier: Apache-2.0
// The mesh of a reconstruction that is done, as tiles that are fetched as fine as the view needs them (3D Tiles).
import {
  BufferAttribute,
  Group,
  MeshBasicMaterial,
  MeshLambertMaterial,
  type Camera,
  type Material,
  type Mesh,
  type Object3D,
  type WebGLRenderer,
} from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { TilesRenderer } from '3d-tiles-renderer/three';
import type { Coloring } from './part_buffer';

// A tile is replaced by finer ones when its vertices may be off by more than this, in pixels.
const FINEST_PIXELS = 1;
const FIRST_PIXELS = 4;
// From one step to the next the number of triangles about doubles, so that what fits is not coarsened again.
const PIXEL_STEP = 1.5;
const ROOM_TO_REFINE = 3;

export class TileLayer {
  readonly group = new Group();
  private readonly tiles: TilesRenderer;
  private readonly materials: Record<'photo' | 'plain', Material>;
  private coloring: 'photo' | 'plain' = 'photo';
  private budget = Infinity;
  private shownFaces = 0;
  private shownTiles = 0;
  private listener = () => {};

  // `offset`: of the coordinates that surfaces and cameras are drawn in, to those of the scene.
  constructor(url: string, offset: readonly number[]) {
    this.materials = {
      photo: new MeshBasicMaterial({ vertexColors: true }),
      // Tiles have no normals; those of their triangles fit together wherever tiles meet.
      plain: new MeshLambertMaterial({ color: 0xd8d4cc, flatShading: true }),
    };
    this.tiles = new TilesRenderer(url);
    this.tiles.errorTarget = FIRST_PIXELS;
    const loader = new GLTFLoader(this.tiles.manager).setMeshoptDecoder(MeshoptDecoder);
    this.tiles.manager.addHandler(/\.glb$/, loader);
    this.place(offset);
    this.group.add(this.tiles.group);
    this.tiles.addEventListener('load-model', ({ scene }) => this.dress(scene));
    this.tiles.addEventListener('needs-update', () => this.listener());
    this.tiles.addEventListener('tiles-load-end', () => this.listener());
  }

  // Calls `listener` when there is something new to be drawn.
  onChange(listener: () => void) {
    this.listener = listener;
  }

  // Something is there to be seen.
  get ready(): boolean {
    return this.shownFaces > 0;
  }

  get faces(): number {
    return this.shownFaces;
  }

  get count(): number {
    return this.shownTiles;
  }

  get complete(): boolean {
    return this.ready && this.tiles.loadProgress === 1;
  }

  // Faces to show, about: with more of them tiles get coarser.
  setBudget(faces: number) {
    this.budget = faces;
    this.listener();
  }

  setColoring(coloring: Coloring) {
    if (coloring === 'camera') return; // what the mesh does not know
    this.coloring = coloring;
    this.tiles.forEachLoadedModel((scene) => this.paint(scene));
  }

  // Before a frame: asks for what the view wants to see.
  update(view: Camera, renderer: WebGLRenderer) {
    view.updateMatrixWorld();
    this.group.updateMatrixWorld();
    this.tiles.setCamera(view);
    this.tiles.setResolutionFromRenderer(view, renderer);
    this.tiles.update();
    this.countShown();
    if (this.complete) this.keepToBudget();
  }

  dispose() {
    this.listener = () => {};
    this.tiles.dispose();
    for (const material of Object.values(this.materials)) material.dispose();
  }

  // A tileset is Z up where a scene's Y points down; one with an offset turns itself back and adds it.
  private place(offset: readonly number[]) {
    const [x = 0, y = 0, z = 0] = offset;
    if (x === 0 && y === 0 && z === 0) this.group.rotation.x = Math.PI / 2;
    else this.group.position.set(-x, -y, -z);
  }

  private dress(scene: Object3D) {
    scene.traverse((object) => {
      const { geometry } = object as Mesh;
      const color = geometry?.getAttribute('color');
      if (color !== undefined) geometry.setAttribute('color', srgbColors(color as BufferAttribute));
    });
    this.paint(scene);
  }

  private paint(scene: Object3D) {
    scene.traverse((object) => {
      const mesh = object as Mesh;
      if (mesh.isMesh) mesh.material = this.materials[this.coloring];
    });
  }

  private countShown() {
    this.shownFaces = 0;
    this.shownTiles = this.tiles.visibleTiles.size;
    this.tiles.group.traverse((object) => {
      const mesh = object as Mesh;
      if (mesh.isMesh) this.shownFaces += (mesh.geometry.index?.count ?? 0) / 3;
    });
  }

  private keepToBudget() {
    const { tiles } = this;
    let target = tiles.errorTarget;
    if (this.shownFaces > this.budget) target *= PIXEL_STEP;
    else if (ROOM_TO_REFINE * this.shownFaces < this.budget) target = Math.max(target / PIXEL_STEP, FINEST_PIXELS);
    if (target === tiles.errorTarget) return;
    tiles.errorTarget = target;
    this.listener();
  }
}

// glTF's colours are linear; the view shows photographs' own.
function srgbColors(linear: BufferAttribute): BufferAttribute {
  const colors = new Uint8Array(4 * linear.count).fill(255);
  for (let i = 0; i < linear.count; ++i) {
    for (let k = 0; k < 3; ++k) {
      const value = linear.getComponent(i, k);
      const srgb = value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055;
      colors[4 * i + k] = Math.round(255 * srgb);
    }
  }
  return new BufferAttribute(colors, 4, true);
}
