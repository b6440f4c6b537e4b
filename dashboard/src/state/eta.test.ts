// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';
import type { Reconstruction, ReconstructionState } from '../api/types';
import { secondsLeft } from './eta';

const END = '2026-11-29T10:00:00Z';
const expected = (state: ReconstructionState, expectedFinishTime?: string): Reconstruction => ({
  id: 'a',
  state: `RECONSTRUCTION_STATE_${state}`,
  expectedFinishTime,
});
const at = (time: string) => Date.parse(time);

describe('secondsLeft', () => {
  it('is what the coordinator says, and runs down', () => {
    expect(secondsLeft(expected('RUNNING', END), at('2026-11-29T09:57:00Z'))).toBe(180);
    expect(secondsLeft(expected('JOINING', END), at('2026-11-29T09:59:50Z'))).toBe(10);
  });
  it('is never nothing before it is done', () => {
    expect(secondsLeft(expected('RUNNING', END), at('2026-11-29T10:03:00Z'))).toBe(1);
  });
  it('says nothing while nothing is known, and when nothing is left', () => {
    expect(secondsLeft(expected('RUNNING'), at(END))).toBeNull();
    for (const state of ['CREATED', 'PREPARING', 'DONE', 'FAILED', 'CANCELLED'] as const) {
      expect(secondsLeft(expected(state, END), at('2026-11-29T09:00:00Z'))).toBeNull();
    }
  });
});
