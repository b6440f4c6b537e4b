// SPDX-License-Identifier: Apache-2.0
// When will it be done? From how fast cameras were committed lately; later cameras are faster, as more is accepted
// before them, so that this errs to the careful side.

export interface Sample {
  timeMs: number;
  committed: number;
}

const WINDOW_MS = 10 * 60_000;
const LEAST_COMMITS = 3;

// The samples that are still worth keeping, with the new one.
export function withSample(samples: readonly Sample[], sample: Sample): Sample[] {
  const recent = samples.filter((old) => old.timeMs >= sample.timeMs - WINDOW_MS && old.committed <= sample.committed);
  const last = recent.at(-1);
  return last !== undefined && last.committed === sample.committed ? recent : [...recent, sample];
}

// Seconds from now; null while nothing can be said. `startMs` stands in while the page has seen too few commits.
export function secondsLeft(samples: readonly Sample[], total: number, startMs: number, nowMs: number): number | null {
  const last = samples.at(-1);
  if (last === undefined || last.committed === 0) return null;
  if (last.committed >= total) return 0;
  const first = samples[0]!;
  const seen = last.committed - first.committed;
  const [commits, milliseconds] =
    seen >= LEAST_COMMITS ? [seen, last.timeMs - first.timeMs] : [last.committed, last.timeMs - startMs];
  if (milliseconds <= 0) return null;
  const left = ((total - last.committed) * milliseconds) / commits - (nowMs - last.timeMs);
  return Math.max(left / 1000, 1);
}
