// SPDX-License-Identifier: Apache-2.0
import type { Attempt } from '../api/types';

// Cameras are committed in one order: the earliest of those in flight is the one that everything waits for.
export function firstInOrder(held: readonly Attempt[]): Attempt | null {
  let first: Attempt | null = null;
  for (const one of held) if (first === null || one.sequence < first.sequence) first = one;
  return first;
}
