// SPDX-License-Identifier: Apache-2.0
// When will it be done? The coordinator knows what the remaining cameras still have to grow, and says so.
import { stateOf, type Reconstruction } from '../api/types';

// Seconds from now until the mesh is there; null while nothing can be said. A clock that is not the coordinator's, or work
// that takes longer than was thought, leaves one second.
export function secondsLeft(reconstruction: Reconstruction, nowMs: number): number | null {
  const state = stateOf(reconstruction);
  if (state !== 'RUNNING' && state !== 'JOINING') return null;
  const end = Date.parse(reconstruction.expectedFinishTime ?? '');
  return Number.isNaN(end) ? null : Math.max((end - nowMs) / 1000, 1);
}
