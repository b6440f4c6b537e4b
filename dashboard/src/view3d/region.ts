// SPDX-License-Identifier: Apache-2.0
// A box in the scene's coordinates, as region.json says it: nothing is reconstructed outside.

export type Region = [number, number, number, number, number, number]; // xmin, ymin, zmin, xmax, ymax, zmax

// With one of its sides moved: it stays within `bounds`, and no side passes the one opposite.
export function moveSide(region: Region, side: number, value: number, bounds: Region): Region {
  const moved: Region = [...region];
  const opposite = region[(side + 3) % 6]!;
  const within = Math.min(Math.max(value, bounds[side % 3]!), bounds[(side % 3) + 3]!);
  moved[side] = side < 3 ? Math.min(within, opposite) : Math.max(within, opposite);
  return moved;
}

// Moved by the scene's offset, for what is drawn lies around zero.
export function regionJson(region: Region, offset: readonly number[]): string {
  return JSON.stringify(region.map((value, i) => value + (offset[i % 3] ?? 0)));
}
