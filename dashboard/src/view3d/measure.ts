// SPDX-License-Identifier: Apache-2.0
// Two points on the surface and the line between them.
import {
  BufferAttribute,
  BufferGeometry,
  Group,
  Line,
  LineBasicMaterial,
  Points,
  PointsMaterial,
  Vector3,
} from 'three';

const COLOR = 0xff4fd8;
const POINT_PX = 9;

export class Measure {
  readonly object = new Group();
  private readonly points: Vector3[] = [];
  private readonly geometry = new BufferGeometry();
  private readonly materials = [
    new LineBasicMaterial({ color: COLOR, depthTest: false }),
    new PointsMaterial({ color: COLOR, size: POINT_PX, sizeAttenuation: false, depthTest: false }),
  ] as const;

  constructor() {
    const line = new Line(this.geometry, this.materials[0]);
    const points = new Points(this.geometry, this.materials[1]);
    for (const drawn of [line, points]) {
      drawn.frustumCulled = false;
      drawn.renderOrder = 1; // over the surface, that covers it otherwise
      this.object.add(drawn);
    }
    this.clear();
  }

  // The third point begins anew.
  add(point: Vector3) {
    if (this.points.length === 2) this.points.length = 0;
    this.points.push(point);
    this.write();
  }

  clear() {
    this.points.length = 0;
    this.write();
  }

  get count(): number {
    return this.points.length;
  }

  // In units of the scene; null until there are two points.
  get distance(): number | null {
    return this.points.length === 2 ? this.points[0]!.distanceTo(this.points[1]!) : null;
  }

  dispose() {
    this.geometry.dispose();
    for (const material of this.materials) material.dispose();
  }

  private write() {
    this.geometry.setAttribute(
      'position',
      new BufferAttribute(new Float32Array(this.points.flatMap((point) => point.toArray())), 3),
    );
  }
}
