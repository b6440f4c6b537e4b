// SPDX-License-Identifier: Apache-2.0
import { useState } from 'preact/hooks';
import type { LogEntry } from '../api/types';
import { clock } from '../format';
import type { ReconstructionStore } from '../state/reconstruction_store';
import { Card, Segmented } from './pieces';

const AT_ONCE = 100;
const KINDS = [
  ['all', 'All'],
  ['failures', 'Failures'],
] as const;

function Entry({ entry, name, onSelect }: { entry: LogEntry; name?: string; onSelect: (camera: number) => void }) {
  return (
    <li class={`log-entry ${entry.severity}`}>
      <time dateTime={entry.time}>{clock(entry.time)}</time>
      <span>
        {entry.severity !== 'info' && <span class={`log-tag ${entry.severity}`}>{entry.severity}</span>}
        {entry.message}
        {entry.camera !== undefined && name !== undefined && (
          <>
            {' '}
            <button class="link" onClick={() => onSelect(entry.camera!)}>
              {name}
            </button>
          </>
        )}
        {entry.worker && <span class="muted"> {entry.worker}</span>}
      </span>
    </li>
  );
}

export function LogCard({ store, onSelect }: { store: ReconstructionStore; onSelect: (camera: number) => void }) {
  const [kind, setKind] = useState<'all' | 'failures'>('all');
  const [shown, setShown] = useState(AT_ONCE);
  const all = store.log.value;
  const failures = all.filter((entry) => entry.severity !== 'info');
  const entries = (kind === 'all' ? all : failures).toReversed();
  return (
    <Card
      title="Log"
      note={failures.length === 0 ? 'no failures' : `${failures.length} with a problem`}
      class="log"
      tools={<Segmented label="Entries" value={kind} options={KINDS} onChange={setKind} />}
    >
      {entries.length === 0 ? (
        <p class="muted">{kind === 'all' ? 'Nothing has happened yet.' : 'Nothing has failed.'}</p>
      ) : (
        <ul class="log-list" tabIndex={0} aria-label="Log, the newest first">
          {entries.slice(0, shown).map((entry, i) => (
            <Entry
              key={`${entry.time}-${i}`}
              entry={entry}
              name={entry.camera === undefined ? undefined : store.cameras.value?.names[entry.camera]}
              onSelect={onSelect}
            />
          ))}
          {entries.length > shown && (
            <li>
              <button class="button small" onClick={() => setShown(shown + 4 * AT_ONCE)}>
                Show older entries
              </button>
            </li>
          )}
        </ul>
      )}
    </Card>
  );
}
