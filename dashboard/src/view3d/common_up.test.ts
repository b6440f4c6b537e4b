// SPDX-License-Identifier: Apache-2.0
import { Matrix4, Vector3 } from 'three';
import { describe, expect, test } from 'vitest';
import { POSE, type CameraTable } from '../api/camera_table';
import { commonUp } from './common_up';

const UP = new Vector3(0.1, 0.9, -0.3).normalize();

// A camera that looks along `forward`, its upper edge turned away from UP by `roll`, radians.
function pose(forward: Vector3, roll: number): number[] {
  const z = forward.clone().normalize();
  const right = z.clone().cross(UP).normalize();
  const turn = new Matrix4().makeRotationAxis(z, roll);
  const x = right.applyMatrix4(turn);
  const y = z.clone().cross(x);
  return [x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z, 0, 0, 0];
}

function tableOf(poses: number[][]): CameraTable {
  const flat = new Float32Array(POSE * poses.length);
  poses.forEach((values, i) => flat.set(values, POSE * i));
  return { count: poses.length, poses: flat } as unknown as CameraTable;
}

function around(count: number, rollOf: (i: number) => number, tilt = 0.3): CameraTable {
  const side = new Vector3(1, 0, 0).cross(UP).normalize();
  const front = UP.clone().cross(side);
  return tableOf(
    Array.from({ length: count }, (_, i) => {
      const angle = (2 * Math.PI * i) / count;
      const forward = side.clone().multiplyScalar(Math.cos(angle)).addScaledVector(front, Math.sin(angle));
      return pose(forward.addScaledVector(UP, -tilt), rollOf(i));
    }),
  );
}

const degreesOff = (up: Vector3 | null) => (up === null ? 180 : (180 / Math.PI) * up.angleTo(UP));

describe('commonUp', () => {
  test('photographs taken upright', () => {
    expect(degreesOff(commonUp(around(12, () => 0)))).toBeLessThan(2);
  });
  test('a third of them taken across, either way', () => {
    const across = around(24, (i) => (i % 3 === 0 ? ((i % 2 === 0 ? 1 : -1) * Math.PI) / 2 : 0));
    expect(degreesOff(commonUp(across))).toBeLessThan(6);
  });
  test('all of them taken across', () => {
    expect(degreesOff(commonUp(around(12, () => Math.PI / 2)))).toBeLessThan(6);
  });
  test('a hand is never still', () => {
    expect(degreesOff(commonUp(around(36, (i) => 0.35 * Math.sin(5 * i))))).toBeLessThan(4);
  });
  test('one camera', () => {
    expect(degreesOff(commonUp(tableOf([pose(new Vector3(1, 0, 0), 0)])))).toBeLessThan(30);
  });
  test('no camera', () => {
    expect(commonUp(tableOf([]))).toBeNull();
  });
});
