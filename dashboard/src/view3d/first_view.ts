// SPDX-License-Identifier: Apache-2.0
// From where a scene is looked at first.
import { Vector3 } from 'three';
import type { CameraTable } from '../api/camera_table';
import { commonUp, sumOfForward } from './common_up';

// Scenes that were photographed from above have Z upwards, for they know where they are on the Earth.
const Z = new Vector3(0, 0, 1);
const FROM_ABOVE = 0.8;
// Cameras that look in all directions have no side in common.
const LEAST_IN_COMMON = 0.5;
const STEEP = 0.85;

export interface FirstView {
  up: Vector3;
  // From the surface towards who looks, unit; null: that depends on where the surface lies among the cameras.
  toViewer: Vector3 | null;
}

// From the side that the photographs were taken from, a little higher; what they show straight from above is seen
// aslant, with their upper edges at the back.
export function firstView(table: CameraTable): FirstView {
  const edge = commonUp(table);
  const toViewer = sumOfForward(table).divideScalar(-Math.max(table.count, 1));
  const up = edge === null || toViewer.z > FROM_ABOVE ? Z.clone() : edge;
  if (toViewer.length() < LEAST_IN_COMMON) return { up, toViewer: null };
  toViewer.normalize();
  if (Math.abs(toViewer.dot(up)) > STEEP) {
    const back = edge === null || Math.abs(edge.dot(up)) > STEEP ? anyNormalTo(up) : edge;
    return { up, toViewer: toViewer.addScaledVector(back, -0.9).normalize() };
  }
  return { up, toViewer: aLittleHigher(toViewer, up) };
}

// The direction, raised and of unit length; in place.
export function aLittleHigher(direction: Vector3, up: Vector3): Vector3 {
  return direction.normalize().addScaledVector(up, 0.35).normalize();
}

export function anyNormalTo(axis: Vector3): Vector3 {
  const other = Math.abs(axis.x) < 0.9 ? new Vector3(1, 0, 0) : new Vector3(0, 1, 0);
  return other.cross(axis).normalize();
}
