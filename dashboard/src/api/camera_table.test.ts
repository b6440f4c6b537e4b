// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';
import { makeCameraTable, POSE } from './camera_table';
import type { Camera } from './types';

describe('makeCameraTable', () => {
  it('inverts the pose: the centre goes to the origin of the camera, its axes to the unit vectors', () => {
    const c = Math.cos(0.7);
    const s = Math.sin(0.7);
    const rotation = [c, 0, -s, 0, 1, 0, s, 0, c];
    const translation = [0.5, -2, 3];
    const camera: Camera = {
      index: 0,
      name: 'a.jpg',
      state: 'CAMERA_STATE_COMMITTED',
      sequence: 4,
      geometry: { width: 400, height: 300, fx: 200, fy: 250, cx: 210, cy: 140, rotation, translation },
      shares: { grown: 0.5 },
      seconds: { growing: 1.5, filtering: 0.5 },
    };
    const table = makeCameraTable([camera]);
    const pose = table.poses.subarray(0, POSE);
    const toCamera = (x: number[]) =>
      [0, 1, 2].map((row) => [0, 1, 2].reduce((sum, k) => sum + rotation[3 * row + k]! * x[k]!, translation[row]!));
    const centre = [...pose.subarray(9)];
    toCamera(centre).forEach((x) => expect(x).toBeCloseTo(0, 6));
    for (let axis = 0; axis < 3; ++axis) {
      const along = centre.map((x, row) => x + pose[3 * row + axis]!);
      toCamera(along).forEach((x, row) => expect(x).toBeCloseTo(row === axis ? 1 : 0, 6));
    }
    expect([...table.frusta]).toEqual([-210 / 200, 190 / 200, -140 / 250, 160 / 250].map(Math.fround));
    expect(table.states[0]).toBe(3);
    expect(table.shares[1]).toBe(0.5);
    expect(table.shares[3]).toBeNaN();
    expect(table.seconds[0]).toBe(2);
  });
});
