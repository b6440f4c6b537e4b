// SPDX-License-Identifier: Apache-2.0
// Where the rays of all photographs went.
import type { Verdict } from '../api/types';
import { percent } from '../format';

const FATES: readonly [name: keyof Verdict, color: string, words: string, title: string][] = [
  ['coverage', 'committed', 'covered', 'Surface that was there before, or that this camera found and others confirm'],
  ['inferred', 'done', 'of it inferred', 'Found on smaller photographs, or closed by the plane around a textureless hole'],
  ['blind', 'waiting', 'matched nothing', 'Nothing there looked alike in other photographs'],
  ['inconsistent', 'assigned', 'inconsistent', 'What grew there did not hold together'],
  ['unsupported', 'lost', 'unconfirmed', 'No other camera found the same'],
  ['contradicted', 'skipped', 'contradicted', 'As many cameras look through it'],
];

export function VerdictBar({ verdict }: { verdict: Verdict }) {
  const share = (name: keyof Verdict) => Number(verdict[name] ?? 0);
  const width = (name: keyof Verdict) => (name === 'coverage' ? share(name) - share('inferred') : share(name));
  return (
    <div class="verdict" title={verdict.summary}>
      <div class="verdict-bar" role="img" aria-label={verdict.summary}>
        {FATES.map(([name, color]) => (
          <span key={name} style={{ width: `${100 * width(name)}%`, background: `var(--state-${color})` }} />
        ))}
      </div>
      <ul class="legend" aria-label="What became of the photographs' rays">
        {FATES.filter(([name]) => share(name) >= 0.0005).map(([name, color, words, title]) => (
          <li key={name} title={title}>
            <span class="dot square" style={{ background: `var(--state-${color})` }} />
            {percent(share(name))} {words}
          </li>
        ))}
      </ul>
    </div>
  );
}
