// SPDX-License-Identifier: Apache-2.0
// How many faces of each part are shown. A mesh may have 50 million; the screen, and the browser, take a budget.

export interface PartDemand {
  faces: number; // of the whole part
  // How much of the screen it covers, in any unit; > 0.
  importance: number;
}

export const FINEST_CAP = 2 ** 20;
// A few triangles where the surface is: better than a hole.
export const COARSEST_CAP = 8;

// The most faces to ask for, per part: a power of two, so that small changes do not make everything be fetched again;
// 0 where not even the coarsest fits, the least important first. The sum of min(faces, cap) never exceeds `budget`.
export function chooseFaceCaps(parts: readonly PartDemand[], budget: number): Uint32Array {
  const caps = new Uint32Array(parts.length);
  if (parts.length === 0) return caps;
  const capAt = (scale: number, part: PartDemand) => {
    const wanted = 2 ** Math.floor(Math.log2(Math.max(scale * part.importance, 1)));
    return Math.min(Math.max(wanted, COARSEST_CAP), FINEST_CAP);
  };
  const total = (scale: number) => {
    let sum = 0;
    for (const part of parts) sum += Math.min(part.faces, capAt(scale, part));
    return sum;
  };

  // Caps are proportional to importance; the largest factor that the budget allows, to a thousandth of an octave.
  let low = -40;
  let high = 60;
  if (total(2 ** high) <= budget) low = high;
  while (high - low > 1e-3) {
    const middle = (low + high) / 2;
    if (total(2 ** middle) <= budget) low = middle;
    else high = middle;
  }
  for (let i = 0; i < parts.length; ++i) caps[i] = capAt(2 ** low, parts[i]!);

  let sum = total(2 ** low);
  if (sum > budget) {
    const leastFirst = Array.from(parts.keys()).sort((a, b) => parts[a]!.importance - parts[b]!.importance || b - a);
    for (const i of leastFirst) {
      if (sum <= budget) break;
      sum -= Math.min(parts[i]!.faces, caps[i]!);
      caps[i] = 0;
    }
  }
  return caps;
}

// Whether what is shown is worth replacing by what is wanted. Finer: when it is at least twice as fine. Coarser: only
// when the budget is needed elsewhere, as what is there looks better and costs nothing more.
export function worthReplacing(shownCap: number, wantedCap: number, faces: number, overBudget: boolean): boolean {
  if (Math.min(shownCap, faces) === Math.min(wantedCap, faces)) return false;
  return wantedCap > shownCap || overBudget;
}

export const SMALLEST_BUDGET = 30_000;
const SLOW_MS = 90;
const FAST_MS = 30;
const STEP = 1.6;

// The budget after a frame of so many faces took the graphics card so long. A machine without one, or a weak one, gets
// fewer triangles instead of a page that stops.
export function nextBudget(budget: number, largest: number, frameMs: number, shownFaces: number): number {
  if (frameMs > SLOW_MS) {
    const shrunk = Math.min(budget, shownFaces) * Math.max(SLOW_MS / 1.5 / frameMs, 1 / STEP ** 2);
    return Math.min(budget, Math.max(SMALLEST_BUDGET, Math.round(shrunk)));
  }
  if (frameMs < FAST_MS && shownFaces > budget / 3) return Math.min(largest, Math.round(budget * STEP));
  return budget;
}
