// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';
import { moveSide, regionJson, type Region } from './region';

const BOUNDS: Region = [-1, -2, -3, 1, 2, 3];

describe('a region', () => {
  it('has one side moved, and the others stay', () => {
    for (let side = 0; side < 6; ++side) {
      const moved = moveSide(BOUNDS, side, 0.25, BOUNDS);
      expect(moved.map((value, i) => (i === side ? value === 0.25 : value === BOUNDS[i]))).not.toContain(false);
    }
  });

  it('stays within its bounds, and its sides never pass each other', () => {
    for (let side = 0; side < 6; ++side) {
      for (const value of [-100, -0.5, 0.5, 100]) {
        let region = moveSide(BOUNDS, side, value, BOUNDS);
        region = moveSide(region, (side + 3) % 6, -value, BOUNDS);
        for (let axis = 0; axis < 3; ++axis) {
          expect(region[axis]!).toBeGreaterThanOrEqual(BOUNDS[axis]!);
          expect(region[axis + 3]!).toBeLessThanOrEqual(BOUNDS[axis + 3]!);
          expect(region[axis]!).toBeLessThanOrEqual(region[axis + 3]!);
        }
      }
    }
  });

  it('is told in the coordinates that the scene came in', () => {
    expect(JSON.parse(regionJson(BOUNDS, [500000, 4000000, 0]))).toEqual([499999, 3999998, -3, 500001, 4000002, 3]);
    expect(JSON.parse(regionJson(BOUNDS, []))).toEqual(BOUNDS);
  });
});
