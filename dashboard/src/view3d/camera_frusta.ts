// SPDX-License-Identifier: Apache-2.0
// All cameras as pyramids in one draw call, coloured by state.
import { BufferAttribute, BufferGeometry, Color, LineBasicMaterial, LineSegments, Vector3, type Camera } from 'three';
import { CAMERA_STATES, type CameraState } from '../api/types';
import { FRUSTUM, POSE, type CameraTable } from '../api/camera_table';

// Also in styles/tokens.css (--state-…): the legend and the lists use those.
const STATE_COLORS: Record<CameraState, number> = {
  WAITING: 0x8a93a3,
  ASSIGNED: 0xe8a317,
  DONE: 0x5b9bf3,
  COMMITTED: 0x22b07d,
  SKIPPED: 0xe5484d,
};
const SELECTED_COLOR = 0xff4fd8;
const EDGES: readonly (readonly [number, number])[] = [
  [0, 1],
  [0, 2],
  [0, 3],
  [0, 4],
  [1, 2],
  [2, 3],
  [3, 4],
  [4, 1],
];
const VERTICES = 2 * EDGES.length;
const PICK_RADIUS_PX = 14;

export class CameraFrusta {
  readonly lines: LineSegments<BufferGeometry, LineBasicMaterial>;
  private count = 0;
  private centers = new Float32Array(0);
  private states = new Uint8Array(0);
  private selected = -1;
  private depth = 0;

  constructor() {
    this.lines = new LineSegments(
      new BufferGeometry(),
      new LineBasicMaterial({ vertexColors: true, transparent: true, opacity: 0.9 }),
    );
    this.lines.frustumCulled = false;
  }

  // `depth`: how far the image plane of a pyramid lies before its camera, scene units.
  set(table: CameraTable, depth: number) {
    if (table.count !== this.count || Math.abs(depth - this.depth) > 0.05 * this.depth) this.rebuild(table, depth);
    for (let i = 0; i < this.count; ++i) {
      if (this.states[i] === table.states[i]) continue;
      this.states[i] = table.states[i]!;
      this.paint(i);
    }
  }

  select(camera: number) {
    const before = this.selected;
    this.selected = camera;
    this.paint(before);
    this.paint(camera);
  }

  centerOf(camera: number): Vector3 {
    return new Vector3().fromArray(this.centers, 3 * camera);
  }

  // The camera whose centre is drawn nearest to (x, y), px; -1 when none is near.
  pick(x: number, y: number, width: number, height: number, view: Camera): number {
    const point = new Vector3();
    let best = -1;
    let bestDistance = PICK_RADIUS_PX;
    for (let i = 0; i < this.count; ++i) {
      point.fromArray(this.centers, 3 * i).project(view);
      if (point.z > 1) continue;
      const distance = Math.hypot(((point.x + 1) / 2) * width - x, ((1 - point.y) / 2) * height - y);
      if (distance >= bestDistance) continue;
      best = i;
      bestDistance = distance;
    }
    return best;
  }

  dispose() {
    this.lines.geometry.dispose();
    this.lines.material.dispose();
  }

  private rebuild(table: CameraTable, depth: number) {
    this.count = table.count;
    this.depth = depth;
    this.centers = new Float32Array(3 * this.count);
    this.states = table.states.slice();
    const positions = new Float32Array(3 * VERTICES * this.count);
    const corners = new Float32Array(15);
    for (let i = 0; i < this.count; ++i) {
      const pose = table.poses.subarray(POSE * i, POSE * (i + 1));
      const [left, right, top, bottom] = table.frusta.subarray(FRUSTUM * i, FRUSTUM * (i + 1));
      corners.set(pose.subarray(9));
      this.centers.set(pose.subarray(9), 3 * i);
      [
        [left!, top!],
        [right!, top!],
        [right!, bottom!],
        [left!, bottom!],
      ].forEach(([x, y], corner) => {
        for (let row = 0; row < 3; ++row) {
          const along = pose[3 * row]! * x! + pose[3 * row + 1]! * y! + pose[3 * row + 2]!;
          corners[3 * (corner + 1) + row] = pose[9 + row]! + depth * along;
        }
      });
      EDGES.forEach(([from, to], edge) => {
        const at = 3 * (VERTICES * i + 2 * edge);
        positions.set(corners.subarray(3 * from, 3 * from + 3), at);
        positions.set(corners.subarray(3 * to, 3 * to + 3), at + 3);
      });
    }
    this.lines.geometry.dispose();
    this.lines.geometry = new BufferGeometry();
    this.lines.geometry.setAttribute('position', new BufferAttribute(positions, 3));
    this.lines.geometry.setAttribute('color', new BufferAttribute(new Uint8Array(3 * VERTICES * this.count), 3, true));
    for (let i = 0; i < this.count; ++i) this.paint(i);
  }

  private paint(camera: number) {
    if (camera < 0 || camera >= this.count) return;
    const color = new Color(
      camera === this.selected ? SELECTED_COLOR : STATE_COLORS[CAMERA_STATES[this.states[camera]!]!],
    );
    const attribute = this.lines.geometry.getAttribute('color') as BufferAttribute;
    for (let i = 0; i < VERTICES; ++i) attribute.setXYZ(VERTICES * camera + i, color.r, color.g, color.b);
    attribute.needsUpdate = true;
  }
}
