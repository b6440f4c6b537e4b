// SPDX-License-Identifier: Apache-2.0
// Which way is up, told from how photographs were taken: upright or across, by hand or from a ring of cameras.
import { Vector3 } from 'three';
import { POSE, type CameraTable } from '../api/camera_table';

const MAX_ROUNDS = 10;
// Photographs taken across or upside down count less as a sign of where up is.
const ACROSS_WEIGHT = 0.6;
const UPSIDE_DOWN_WEIGHT = 0.2;

// The direction that the upper edges of photographs have in common, each turned by a quarter where that fits better. null
// when there is none: cameras that look straight down in all directions.
export function commonUp(table: CameraTable): Vector3 | null {
  if (table.count === 0) return null;
  const found: { up: Vector3; score: number }[] = [];
  for (const seed of seeds(table)) {
    const up = seed.clone();
    let score = 0;
    for (let round = 0; round < MAX_ROUNDS; ++round) {
      const sum = new Vector3();
      for (let i = 0; i < table.count; ++i) sum.add(nearestEdge(table, i, up));
      score = sum.length() / table.count;
      if (score < 1e-6) break;
      sum.normalize();
      if (sum.distanceTo(up) < 1e-4) break;
      up.copy(sum);
    }
    found.push({ up, score });
  }
  const bestScore = Math.max(0, ...found.map(({ score }) => score));
  if (bestScore < 0.05) return null;
  // Photographs that are all across fit both ways; people look down rather than up.
  const forward = sumOfForward(table);
  const good = found.filter(({ score }) => score > 0.98 * bestScore);
  return good.reduce((a, b) => (b.up.dot(forward) < a.up.dot(forward) - 1e-6 ? b : a)).up;
}

// Of all cameras, in world coordinates.
export function sumOfForward(table: CameraTable): Vector3 {
  const sum = new Vector3();
  for (let i = 0; i < table.count; ++i) sum.add(axis(table, i, 2));
  return sum;
}

// X of a camera points right, Y down, Z forward.
function axis(table: CameraTable, camera: number, column: number): Vector3 {
  const pose = table.poses.subarray(POSE * camera, POSE * (camera + 1));
  return new Vector3(pose[column], pose[3 + column], pose[6 + column]);
}

function seeds(table: CameraTable): Vector3[] {
  const mean = [new Vector3(), new Vector3()];
  for (let i = 0; i < table.count; ++i) {
    mean[0]!.sub(axis(table, i, 1));
    mean[1]!.add(axis(table, i, 0));
  }
  const directions = mean.filter((direction) => direction.length() > 1e-6).map((direction) => direction.normalize());
  // Means of photographs that were turned in all ways say nothing; single ones do.
  for (const camera of [0, table.count >> 1, table.count - 1]) {
    if (camera < table.count) directions.push(axis(table, camera, 1).negate(), axis(table, camera, 0));
  }
  return directions.flatMap((direction) => [direction, direction.clone().negate()]);
}

// The edge of the photograph that `up` is nearest to, as long as it counts.
function nearestEdge(table: CameraTable, camera: number, up: Vector3): Vector3 {
  const upper = axis(table, camera, 1).negate();
  const right = axis(table, camera, 0);
  const edges: [Vector3, number][] = [
    [upper, 1],
    [right, ACROSS_WEIGHT],
    [right.clone().negate(), ACROSS_WEIGHT],
    [upper.clone().negate(), UPSIDE_DOWN_WEIGHT],
  ];
  let best = edges[0]!;
  for (const edge of edges) {
    if (edge[0].dot(up) > best[0].dot(up)) best = edge;
  }
  return best[0].multiplyScalar(best[1]);
}
