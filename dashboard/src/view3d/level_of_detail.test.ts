// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';
import {
  chooseFaceCaps,
  COARSEST_CAP,
  nextBudget,
  SMALLEST_BUDGET,
  worthReplacing,
  type PartDemand,
} from './level_of_detail';

// Deterministic numbers in [0, 1): the laws must hold for any parts.
function numbers(seed: number) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

function someParts(count: number, seed: number): PartDemand[] {
  const next = numbers(seed);
  return Array.from({ length: count }, () => ({ faces: Math.floor(next() * 20_000), importance: 0.01 + next() ** 3 }));
}

const shown = (parts: PartDemand[], caps: Uint32Array) =>
  parts.reduce((sum, part, i) => sum + Math.min(part.faces, caps[i]!), 0);

describe('chooseFaceCaps', () => {
  for (const count of [0, 1, 2, 37, 5000]) {
    for (const budget of [0, 100, 50_000, 2_000_000]) {
      it(`keeps to the budget: ${count} parts, ${budget} faces`, () => {
        const parts = someParts(count, count + budget);
        const caps = chooseFaceCaps(parts, budget);
        expect(shown(parts, caps)).toBeLessThanOrEqual(budget);
        for (const cap of caps) expect(cap === 0 || Number.isInteger(Math.log2(cap))).toBe(true);
      });
    }
  }

  it('shows everything whole when the budget allows it', () => {
    const parts = someParts(100, 5);
    const all = parts.reduce((sum, part) => sum + part.faces, 0);
    expect(shown(parts, chooseFaceCaps(parts, all))).toBe(all);
  });

  it('uses at least a third of the budget when there is enough to show', () => {
    const parts = someParts(5000, 6).map((part) => ({ ...part, faces: 10_000 }));
    const used = shown(parts, chooseFaceCaps(parts, 2_000_000));
    expect(used).toBeGreaterThan(2_000_000 / 3);
  });

  it('never gives a less important part more', () => {
    const parts = someParts(500, 7).map((part) => ({ ...part, faces: 1e6 }));
    for (const budget of [10_000, 30_000, 1_000_000]) {
      const caps = chooseFaceCaps(parts, budget);
      const order = Array.from(parts.keys()).sort((a, b) => parts[a]!.importance - parts[b]!.importance);
      for (let i = 1; i < order.length; ++i) expect(caps[order[i - 1]!]!).toBeLessThanOrEqual(caps[order[i]!]!);
    }
  });

  it('never shows less for a larger budget', () => {
    const parts = someParts(200, 8);
    let before = 0;
    for (let budget = COARSEST_CAP; budget < 3e6; budget *= 1.7) {
      const now = shown(parts, chooseFaceCaps(parts, budget));
      expect(now).toBeGreaterThanOrEqual(before);
      before = now;
    }
  });
});

describe('worthReplacing', () => {
  it('refines when more is wanted and there is more', () => {
    expect(worthReplacing(256, 512, 10_000, false)).toBe(true);
    expect(worthReplacing(256, 512, 200, false)).toBe(false);
  });
  it('coarsens only to stay in the budget', () => {
    expect(worthReplacing(512, 256, 10_000, false)).toBe(false);
    expect(worthReplacing(512, 256, 10_000, true)).toBe(true);
  });
});

describe('nextBudget', () => {
  const LARGEST = 1_500_000;
  // A graphics card that takes so long for a frame, and so long for each face.
  const settle = (start: number, frameMs: (faces: number) => number) => {
    const budgets = [start];
    for (let frame = 0; frame < 100; ++frame) {
      const budget = budgets.at(-1)!;
      budgets.push(nextBudget(budget, LARGEST, frameMs(budget), budget));
    }
    return budgets;
  };

  it('gives a fast card everything', () => {
    expect(settle(100_000, (faces) => faces / 1e6).at(-1)).toBe(LARGEST);
  });
  it('settles where frames are neither slow nor needlessly coarse', () => {
    for (const facesPerMs of [700, 1500, 4000, 12_000]) {
      const budgets = settle(LARGEST, (faces) => faces / facesPerMs);
      const last = budgets.at(-1)!;
      expect(last / facesPerMs).toBeLessThanOrEqual(90);
      expect(last / facesPerMs).toBeGreaterThanOrEqual(Math.min(25, LARGEST / facesPerMs));
      expect(new Set(budgets.slice(-20)).size).toBe(1); // no swinging
    }
  });
  it('never leaves its bounds', () => {
    expect(settle(LARGEST, () => 10_000).at(-1)).toBe(SMALLEST_BUDGET);
    expect(settle(SMALLEST_BUDGET, () => 0).at(-1)).toBe(LARGEST);
  });
  it('does not grow while little is shown, which says nothing', () => {
    expect(nextBudget(100_000, LARGEST, 1, 10_000)).toBe(100_000);
  });
});
