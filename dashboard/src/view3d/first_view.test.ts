// SPDX-License-Identifier: Apache-2.0
import { Vector3 } from 'three';
import { describe, expect, test } from 'vitest';
import { POSE, type CameraTable } from '../api/camera_table';
import { firstView } from './first_view';

// Cameras that look along `forward` with their upper edges towards `up`.
function tableOf(cameras: { forward: Vector3; up: Vector3 }[]): CameraTable {
  const poses = new Float32Array(POSE * cameras.length);
  cameras.forEach(({ forward, up }, i) => {
    const z = forward.clone().normalize();
    const x = z.clone().cross(up).normalize();
    const y = z.clone().cross(x);
    poses.set([x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z], POSE * i);
  });
  return { count: cameras.length, poses } as unknown as CameraTable;
}

const X = new Vector3(1, 0, 0);
const Y = new Vector3(0, 1, 0);
const Z = new Vector3(0, 0, 1);
const down = Z.clone().negate();

describe('firstView', () => {
  test('a flight that looks straight down is seen aslant from the south, with north at the back', () => {
    const flight = Array.from({ length: 40 }, (_, i) => ({ forward: down, up: i % 4 === 0 ? Y.clone().negate() : Y }));
    const { up, toViewer } = firstView(tableOf(flight));
    expect(up.dot(Z)).toBeCloseTo(1);
    expect(toViewer!.z).toBeGreaterThan(0.5);
    expect(toViewer!.y).toBeLessThan(-0.4);
  });
  test('a facade is seen from its front, a little higher', () => {
    const { up, toViewer } = firstView(tableOf(Array.from({ length: 9 }, () => ({ forward: Y, up: Z }))));
    expect(up.dot(Z)).toBeCloseTo(1);
    expect(toViewer!.y).toBeLessThan(-0.8);
    expect(toViewer!.z).toBeGreaterThan(0.2);
  });
  test('a facade whose coordinates have another axis upwards, too', () => {
    const { up, toViewer } = firstView(tableOf(Array.from({ length: 9 }, () => ({ forward: Z, up: Y }))));
    expect(up.dot(Y)).toBeCloseTo(1);
    expect(toViewer!.z).toBeLessThan(-0.8);
  });
  test('cameras all around have no side in common', () => {
    const ring = Array.from({ length: 12 }, (_, i) => {
      const angle = (2 * Math.PI * i) / 12;
      return { forward: X.clone().multiplyScalar(Math.cos(angle)).addScaledVector(Y, Math.sin(angle)), up: Z };
    });
    const { up, toViewer } = firstView(tableOf(ring));
    expect(up.dot(Z)).toBeCloseTo(1);
    expect(toViewer).toBeNull();
  });
  test('no camera', () => {
    expect(firstView(tableOf([])).toViewer).toBeNull();
  });
});
