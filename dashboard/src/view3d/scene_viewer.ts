// SPDX-License-Identifier: Apache-2.0
// The mesh and its cameras on a canvas. Draws only when something has changed.
import {
  AmbientLight,
  Box3,
  Box3Helper,
  Color,
  ColorManagement,
  DirectionalLight,
  LinearSRGBColorSpace,
  PerspectiveCamera,
  Quaternion,
  Raycaster,
  Scene,
  Sphere,
  Spherical,
  Vector2,
  Vector3,
  WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { FRUSTUM, POSE, type CameraTable } from '../api/camera_table';
import { CameraFrusta } from './camera_frusta';
import { aLittleHigher, anyNormalTo, firstView } from './first_view';
import { Measure } from './measure';
import { PartBuffer, type Coloring } from './part_buffer';
import type { LoadedPart } from './part_loader';
import { placePhoto, type PhotoPlace } from './photo_place';
import type { PartGeometry } from './preview_decoder';
import type { Region } from './region';
import type { TileLayer } from './tile_layer';

export interface SceneViewerCallbacks {
  onPick: (camera: number) => void;
  // The view has come to rest.
  onRest: () => void;
  // So long the graphics card took for the last frame.
  onFrame: (milliseconds: number) => void;
  // The view stands where a camera stood, whose photograph lies there on the canvas; null: it does no more.
  onLookThrough: (camera: number, place: PhotoPlace | null) => void;
  // A point was measured; null until there are two.
  onMeasure: (points: number, distance: number | null) => void;
}

// Photographs' colours go to the screen as they are.
ColorManagement.enabled = false;

const FIELD_OF_VIEW = 45; // degrees
const REGION_COLOR = 0xff4fd8;
const REST_MS = 250;
// Frames that only show that more has come need not be many; software rendering leaves little time for anything else.
const MS_BETWEEN_GROWTH_FRAMES = 150;
const LONGEST_FRAME_MS = 5000;
// So much of a frame may go into taking up new parts.
const MS_PER_FRAME = 8;

export class SceneViewer {
  // There is no graphics card, or the browser does not use it.
  readonly inSoftware: boolean;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly view = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 1000);
  private controls: OrbitControls;
  private readonly parts = new PartBuffer();
  private readonly frusta = new CameraFrusta();
  private readonly light = new DirectionalLight(0xffffff, 1.9);
  private readonly measure = new Measure();
  private readonly region = new Box3Helper(new Box3(), REGION_COLOR);
  private readonly resizing: ResizeObserver;
  private readonly up = new Vector3(0, 0, 1);
  private toViewer: Vector3 | null = null;
  private readonly cameraBox = new Box3();
  private readonly partBox = new Box3();
  private tiles: TileLayer | null = null;
  private tileBudget = Infinity;
  private coloring: Coloring = 'photo';
  private queue: { part: LoadedPart; geometry: PartGeometry | null }[] = [];
  private table: CameraTable | null = null;
  private frameRequested = 0;
  private frameUnderWay = false;
  private frameMs = 0;
  private wanted = false;
  private fenceTimer: ReturnType<typeof setTimeout> | undefined;
  private restTimer: ReturnType<typeof setTimeout> | undefined;
  private growthTimer: ReturnType<typeof setTimeout> | undefined;
  private movedByHand = false;
  private measuring = false;
  private lookingThrough = -1; // the camera
  private fittedRadius = 0;
  private fittedSurface = false;
  private pressed: { x: number; y: number } | null = null;

  // Throws where there is no WebGL 2.
  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly callbacks: SceneViewerCallbacks,
  ) {
    this.inSoftware = drawsInSoftware();
    this.renderer = new WebGLRenderer({
      canvas,
      antialias: !this.inSoftware,
      powerPreference: 'high-performance',
    });
    // Asking how a shader was compiled makes the page wait until it is.
    this.renderer.debug.checkShaderErrors = import.meta.env.DEV;
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.region.visible = false;
    this.scene.add(this.parts.mesh, this.frusta.lines, this.measure.object, this.region);
    this.scene.add(new AmbientLight(0xffffff, 1.1), this.light);
    this.view.up.copy(this.up);
    this.controls = this.makeControls();
    canvas.addEventListener('pointerdown', this.press);
    canvas.addEventListener('pointerup', this.release);
    this.resizing = new ResizeObserver(() => this.resize());
    this.resizing.observe(canvas);
    this.resize();
  }

  setBackground(color: string) {
    this.scene.background = new Color(color);
    this.draw();
  }

  setColoring(coloring: Coloring) {
    this.coloring = coloring;
    this.parts.setColoring(coloring);
    this.tiles?.setColoring(coloring);
    this.draw();
  }

  // The one mesh in the place of the surfaces that it was joined from; null: those again.
  showTiles(tiles: TileLayer | null) {
    if (this.tiles !== null) this.scene.remove(this.tiles.group);
    this.tiles = tiles;
    if (tiles !== null) {
      tiles.onChange(() => this.draw());
      tiles.setColoring(this.coloring);
      tiles.setBudget(this.tileBudget);
      this.scene.add(tiles.group);
    }
    this.draw();
  }

  // Triangles of the mesh to show, about.
  setTileBudget(faces: number) {
    this.tileBudget = faces;
    this.tiles?.setBudget(faces);
  }

  // Tiles of the mesh that are seen; 0 while it is the surfaces.
  get shownTiles(): number {
    return this.showsTiles ? this.tiles!.count : 0;
  }

  // Not where colours are those of cameras, which the mesh does not know.
  private get showsTiles(): boolean {
    return this.tiles !== null && this.tiles.ready && this.coloring !== 'camera';
  }

  showFrusta(shown: boolean) {
    this.frusta.lines.visible = shown;
    this.draw();
  }

  setCameras(table: CameraTable) {
    const first = this.table === null || this.table.count !== table.count;
    this.table = table;
    if (table.count === 0) return;
    if (first) this.takeUpCameras(table);
    this.frusta.set(table, this.cameraSpacing(table));
    // Cameras may come when somebody looks at the first surface already.
    if (first && !this.movedByHand) this.fit();
    this.draw();
  }

  // Another level of detail of a part, or nothing of it any more.
  show(part: LoadedPart, geometry: PartGeometry | null) {
    this.queue.push({ part, geometry });
    this.growthTimer ??= setTimeout(
      () => {
        this.growthTimer = undefined;
        this.draw();
      },
      Math.max(MS_BETWEEN_GROWTH_FRAMES, 3 * this.frameMs),
    );
  }

  get shownFaces(): number {
    return this.showsTiles ? this.tiles!.faces : this.parts.faces;
  }

  select(camera: number) {
    this.frusta.select(camera);
    this.draw();
  }

  // Stands where the camera stood and looks where it looked, held as it was held.
  lookThrough(camera: number) {
    if (this.table === null || camera < 0) return;
    const pose = this.table.poses.subarray(POSE * camera, POSE * (camera + 1));
    const forward = new Vector3(pose[2], pose[5], pose[8]);
    const center = this.frusta.centerOf(camera);
    const distance = Math.max(this.boxToFit().getCenter(new Vector3()).sub(center).dot(forward), this.radius() * 0.2);
    this.turnUp(new Vector3(-pose[1]!, -pose[4]!, -pose[7]!));
    this.view.position.copy(center);
    this.controls.target.copy(center).addScaledVector(forward, distance);
    this.movedByHand = true;
    this.controls.update();
    this.lookingThrough = camera;
    this.placePhoto();
    this.changed();
  }

  // While it is on, a click on the surface is a point to measure from, or to.
  setMeasuring(on: boolean) {
    this.measuring = on;
    this.measure.clear();
    this.callbacks.onMeasure(0, null);
    this.draw();
  }

  // Whether all that it was told to show is there.
  get upToDate(): boolean {
    return this.queue.length === 0 && (!this.showsTiles || this.tiles!.complete);
  }

  // What the surface fills; null while there is none.
  get surfaceRegion(): Region | null {
    const { min, max } = this.partBox;
    return this.partBox.isEmpty() ? null : [min.x, min.y, min.z, max.x, max.y, max.z];
  }

  showRegion(region: Region | null) {
    this.region.visible = region !== null;
    if (region !== null) {
      this.region.box.min.fromArray(region);
      this.region.box.max.fromArray(region, 3);
    }
    this.draw();
  }

  // The surface in view, upright, from where the cameras stand; the cameras where there is none yet.
  fit() {
    const box = this.boxToFit();
    if (box.isEmpty()) return;
    this.leaveCamera();
    this.setFieldOfView(FIELD_OF_VIEW);
    this.turnUp(this.up);
    const center = box.getCenter(new Vector3());
    const radius = this.radiusToFit();
    this.fittedRadius = radius;
    this.fittedSurface = !this.partBox.isEmpty();
    const direction = this.toViewer?.clone() ?? this.fromCamerasBeside(center, radius);
    const narrow = Math.min(1, this.view.aspect);
    const distance = (0.75 * radius) / (Math.tan((this.view.fov * Math.PI) / 360) * narrow);
    this.view.position.copy(center).addScaledVector(direction, distance);
    this.controls.target.copy(center);
    this.controls.update();
    this.movedByHand = false;
    this.changed();
  }

  // Angles in radians; `zoom` multiplies the distance.
  orbit(azimuth: number, polar: number, zoom: number) {
    this.leaveCamera();
    const offset = this.view.position.clone().sub(this.controls.target);
    const toY = new Vector3(0, 1, 0);
    const turned = offset.clone().applyQuaternion(quaternionBetween(this.view.up, toY));
    const spherical = new Spherical().setFromVector3(turned);
    spherical.theta += azimuth;
    spherical.phi = Math.min(Math.max(spherical.phi + polar, 0.02), Math.PI - 0.02);
    spherical.radius *= zoom;
    offset.setFromSpherical(spherical).applyQuaternion(quaternionBetween(toY, this.view.up));
    this.view.position.copy(this.controls.target).add(offset);
    this.movedByHand = true;
    this.controls.update();
    this.changed();
  }

  // The share of the view's height that the part fills, squared; far less when it is not in view.
  importanceOf(part: LoadedPart): number {
    const center = new Vector3(...part.center!);
    const distance = Math.max(center.distanceTo(this.view.position) - part.radius, part.radius * 0.1, 1e-9);
    const size = Math.min(part.radius / distance, 4);
    center.project(this.view);
    const margin = 1 + size;
    const inView = Math.abs(center.x) < margin && Math.abs(center.y) < margin && center.z < 1;
    return size * size * (inView ? 1 : 0.05);
  }

  dispose() {
    cancelAnimationFrame(this.frameRequested);
    clearTimeout(this.restTimer);
    clearTimeout(this.growthTimer);
    clearTimeout(this.fenceTimer);
    this.resizing.disconnect();
    this.canvas.removeEventListener('pointerdown', this.press);
    this.canvas.removeEventListener('pointerup', this.release);
    this.controls.dispose();
    this.parts.dispose();
    this.frusta.dispose();
    this.measure.dispose();
    this.region.dispose();
    this.renderer.dispose();
  }

  private readonly press = (event: PointerEvent) => (this.pressed = { x: event.offsetX, y: event.offsetY });

  private readonly release = (event: PointerEvent) => {
    const { pressed } = this;
    this.pressed = null;
    if (pressed === null || Math.hypot(event.offsetX - pressed.x, event.offsetY - pressed.y) > 4) return;
    if (this.measuring) return this.measureAt(event.offsetX, event.offsetY);
    if (!this.frusta.lines.visible) return;
    const { clientWidth, clientHeight } = this.canvas;
    const camera = this.frusta.pick(event.offsetX, event.offsetY, clientWidth, clientHeight, this.view);
    if (camera >= 0) this.callbacks.onPick(camera);
  };

  private measureAt(x: number, y: number) {
    const { clientWidth, clientHeight } = this.canvas;
    const ray = new Raycaster();
    this.view.updateMatrixWorld(); // the frame that does it may still be to come
    ray.setFromCamera(new Vector2((2 * x) / clientWidth - 1, 1 - (2 * y) / clientHeight), this.view);
    const { geometry } = this.parts.mesh;
    geometry.boundingSphere = this.partBox.getBoundingSphere(new Sphere());
    const hit = ray.intersectObject(this.showsTiles ? this.tiles!.group : this.parts.mesh)[0];
    if (hit === undefined) return;
    this.measure.add(hit.point);
    this.callbacks.onMeasure(this.measure.count, this.measure.distance);
    this.draw();
  }

  private placePhoto() {
    if (this.table === null || this.lookingThrough < 0) return;
    const frustum = this.table.frusta.subarray(FRUSTUM * this.lookingThrough, FRUSTUM * (this.lookingThrough + 1));
    const place = placePhoto(frustum, this.canvas.clientWidth, this.canvas.clientHeight);
    this.setFieldOfView(place.fieldOfView);
    this.callbacks.onLookThrough(this.lookingThrough, place);
  }

  private leaveCamera() {
    if (this.lookingThrough < 0) return;
    this.callbacks.onLookThrough(this.lookingThrough, null);
    this.lookingThrough = -1;
  }

  private setFieldOfView(degrees: number) {
    this.view.fov = degrees;
    this.view.updateProjectionMatrix();
  }

  private makeControls(): OrbitControls {
    const controls = new OrbitControls(this.view, this.canvas);
    // A click alone does not move.
    controls.addEventListener('change', () => this.pressed !== null && this.leaveCamera());
    controls.addEventListener('start', () => (this.movedByHand = true));
    controls.addEventListener('change', () => this.changed());
    return controls;
  }

  private changed() {
    this.draw();
    clearTimeout(this.restTimer);
    this.restTimer = setTimeout(() => this.callbacks.onRest(), REST_MS);
  }

  private draw() {
    this.wanted = true;
    // One frame at a time: whoever sends more than the graphics card takes is made to wait by the browser.
    if (this.frameRequested !== 0 || this.frameUnderWay) return;
    this.frameRequested = requestAnimationFrame(() => {
      this.frameRequested = 0;
      this.wanted = false;
      this.takeUpParts();
      this.light.position.copy(this.view.position).addScaledVector(this.up, this.radius() * 0.3);
      this.light.target.position.copy(this.controls.target);
      this.light.target.updateMatrixWorld();
      this.placeClippingPlanes();
      this.updateTiles();
      this.renderer.render(this.scene, this.view);
      this.waitForFrame();
      if (this.queue.length > 0) this.wanted = true;
    });
  }

  private updateTiles() {
    const { tiles } = this;
    if (tiles !== null && this.coloring !== 'camera') tiles.update(this.view, this.renderer);
    if (tiles !== null) tiles.group.visible = this.showsTiles;
    this.parts.mesh.visible = !this.showsTiles;
  }

  private waitForFrame() {
    const context = this.renderer.getContext() as WebGL2RenderingContext;
    const fence = context.fenceSync(context.SYNC_GPU_COMMANDS_COMPLETE, 0);
    context.flush();
    const began = performance.now();
    this.frameUnderWay = true;
    const look = () => {
      const done = fence === null || context.getSyncParameter(fence, context.SYNC_STATUS) === context.SIGNALED;
      if (!done && !context.isContextLost() && performance.now() - began < LONGEST_FRAME_MS) {
        this.fenceTimer = setTimeout(look, 4);
        return;
      }
      context.deleteSync(fence);
      this.frameUnderWay = false;
      this.frameMs = performance.now() - began;
      this.callbacks.onFrame(this.frameMs);
      if (this.wanted) this.draw();
    };
    this.fenceTimer = setTimeout(look, 0);
  }

  private takeUpParts() {
    const until = performance.now() + MS_PER_FRAME;
    let taken = 0;
    while (taken < this.queue.length && (taken === 0 || performance.now() < until)) {
      const { part, geometry } = this.queue[taken++]!;
      if (geometry === null) {
        this.parts.remove(part.sequence);
        continue;
      }
      this.parts.put(part.sequence, part.camera, geometry);
      if (geometry.indices.length === 0) continue;
      this.partBox.expandByPoint(new Vector3(...geometry.min)).expandByPoint(new Vector3(...geometry.max));
    }
    this.queue.splice(0, taken);
    // What grows stays in view until somebody looks elsewhere.
    const isOutgrown = this.fittedSurface === this.partBox.isEmpty() || this.radiusToFit() > 1.1 * this.fittedRadius;
    if (!this.movedByHand && isOutgrown) this.fit();
  }

  private takeUpCameras(table: CameraTable) {
    this.cameraBox.makeEmpty();
    for (let i = 0; i < table.count; ++i) {
      const pose = table.poses.subarray(POSE * i, POSE * (i + 1));
      this.cameraBox.expandByPoint(new Vector3(pose[9], pose[10], pose[11]));
    }
    const { up, toViewer } = firstView(table);
    this.up.copy(up);
    this.toViewer = toViewer;
    this.turnUp(up);
  }

  // What is up on the screen. The controls read it once, when they are made.
  private turnUp(up: Vector3) {
    if (this.view.up.distanceTo(up) < 1e-9) return;
    this.view.up.copy(up);
    const { target } = this.controls;
    this.controls.dispose();
    this.controls = this.makeControls();
    this.controls.target.copy(target);
  }

  // Pyramids as large as the gaps between cameras let them be.
  private cameraSpacing(table: CameraTable): number {
    const size = this.cameraBox.getSize(new Vector3());
    const sides = [size.x, size.y, size.z].sort((a, b) => b - a);
    const area = Math.max(sides[0]! * Math.max(sides[1]!, sides[0]! * 0.1), 1e-12);
    return 0.35 * Math.sqrt(area / Math.max(table.count, 1));
  }

  private boxOfAll(): Box3 {
    return this.cameraBox.clone().union(this.partBox);
  }

  private boxToFit(): Box3 {
    return this.partBox.isEmpty() ? this.cameraBox.clone() : this.partBox.clone();
  }

  private radius(): number {
    return radiusOf(this.boxOfAll());
  }

  private radiusToFit(): number {
    return radiusOf(this.boxToFit());
  }

  // Where cameras look in all directions: from their middle, or aslant from above where that is in the surface.
  private fromCamerasBeside(center: Vector3, radius: number): Vector3 {
    const direction = this.cameraBox.getCenter(new Vector3()).sub(center);
    if (direction.length() < 0.15 * radius) direction.copy(this.up).addScaledVector(anyNormalTo(this.up), 1.2);
    return aLittleHigher(direction, this.up);
  }

  private placeClippingPlanes() {
    const box = this.boxOfAll();
    if (box.isEmpty()) return;
    const far = box.getCenter(new Vector3()).distanceTo(this.view.position) + box.getSize(new Vector3()).length();
    this.view.far = far;
    this.view.near = Math.max(far / 20_000, Math.min(box.distanceToPoint(this.view.position) * 0.5, far / 10));
    this.view.updateProjectionMatrix();
  }

  private resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.view.aspect = width / height;
    this.view.updateProjectionMatrix();
    this.placePhoto();
    this.draw();
  }
}

function radiusOf(box: Box3): number {
  return box.isEmpty() ? 1e-6 : Math.max(box.getSize(new Vector3()).length() / 2, 1e-6);
}

function drawsInSoftware(): boolean {
  const context = document.createElement('canvas').getContext('webgl2');
  const info = context?.getExtension('WEBGL_debug_renderer_info');
  const name = info ? String(context!.getParameter(info.UNMASKED_RENDERER_WEBGL)) : '';
  context?.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

function quaternionBetween(from: Vector3, to: Vector3): Quaternion {
  return new Quaternion().setFromUnitVectors(from, to);
}
