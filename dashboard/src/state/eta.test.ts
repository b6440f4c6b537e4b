// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';
import { secondsLeft, withSample, type Sample } from './eta';

const steady = (count: number, everyMs: number) => {
  let samples: Sample[] = [];
  for (let i = 0; i <= count; ++i) samples = withSample(samples, { timeMs: i * everyMs, committed: i });
  return samples;
};

describe('secondsLeft', () => {
  it('is the rest divided by the rate', () => {
    expect(secondsLeft(steady(10, 2000), 100, 0, 20_000)).toBeCloseTo(180);
  });
  it('runs down between two commits', () => {
    const samples = steady(10, 2000);
    expect(secondsLeft(samples, 100, 0, 21_000)!).toBeCloseTo(secondsLeft(samples, 100, 0, 20_000)! - 1);
  });
  it('says nothing before the first commit, and zero after the last', () => {
    expect(secondsLeft([{ timeMs: 0, committed: 0 }], 10, 0, 5000)).toBeNull();
    expect(secondsLeft(steady(10, 1000), 10, 0, 10_000)).toBe(0);
  });
  it('takes the time since the start when the page has just been opened', () => {
    expect(secondsLeft([{ timeMs: 60_000, committed: 30 }], 60, 0, 60_000)).toBeCloseTo(60);
  });
  it('forgets what is longer ago than ten minutes', () => {
    let samples = steady(5, 1000);
    for (let i = 0; i < 20; ++i) samples = withSample(samples, { timeMs: 3_600_000 + 60_000 * i, committed: 6 + i });
    expect(secondsLeft(samples, 35, 0, samples.at(-1)!.timeMs)).toBeCloseTo(600);
  });
});
