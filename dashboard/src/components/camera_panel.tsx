// SPDX-License-Identifier: Apache-2.0
// Every camera in a list that can be searched, and one of them with its photograph, neighbours and numbers.
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import { SHARES, stateOfCamera, type CameraTable } from '../api/camera_table';
import { reconstructionUrl } from '../api/client';
import type { Camera, CameraState } from '../api/types';
import { count, counted, duration, percent } from '../format';
import type { ReconstructionStore } from '../state/reconstruction_store';
import { Notice } from './pieces';

const ROW_PX = 34;
const STATE_WORDS: Record<CameraState, string> = {
  WAITING: 'waiting',
  ASSIGNED: 'under way',
  DONE: 'processed',
  COMMITTED: 'committed',
  SKIPPED: 'skipped',
};
const STAGES = ['loading', 'visibility', 'seeding', 'growing', 'filtering', 'refinement'];

interface Props {
  store: ReconstructionStore;
  selected: number;
  onSelect: (camera: number) => void;
}

function StateDot({ state }: { state: CameraState }) {
  return <span class="dot" style={{ background: `var(--state-${state.toLowerCase().replace('_', '-')})` }} />;
}

// Only the rows that are in view exist.
function CameraList({ table, onSelect }: { table: CameraTable; onSelect: (camera: number) => void }) {
  const [search, setSearch] = useState('');
  const [active, setActive] = useState(0);
  const [scroll, setScroll] = useState({ top: 0, height: 400 });
  const list = useRef<HTMLDivElement>(null);
  const found = useMemo(() => {
    const wanted = search.trim().toLowerCase();
    const indices: number[] = [];
    for (let i = 0; i < table.count; ++i) {
      if (wanted === '' || table.names[i]!.toLowerCase().includes(wanted)) indices.push(i);
    }
    return indices;
  }, [table.names, search]);
  const first = Math.max(0, Math.floor(scroll.top / ROW_PX) - 4);
  const last = Math.min(found.length, Math.ceil((scroll.top + scroll.height) / ROW_PX) + 4);
  const measure = () => {
    const element = list.current;
    if (element !== null) setScroll({ top: element.scrollTop, height: element.clientHeight });
  };
  useEffect(measure, []);

  const move = (to: number) => {
    const row = Math.max(0, Math.min(found.length - 1, to));
    setActive(row);
    const element = list.current!;
    if (row * ROW_PX < element.scrollTop) element.scrollTop = row * ROW_PX;
    const below = (row + 1) * ROW_PX - element.clientHeight;
    if (below > element.scrollTop) element.scrollTop = below;
    measure();
  };
  const onKeyDown = (event: KeyboardEvent) => {
    const page = Math.floor(scroll.height / ROW_PX);
    const to: Record<string, number> = {
      ArrowDown: active + 1,
      ArrowUp: active - 1,
      PageDown: active + page,
      PageUp: active - page,
      Home: 0,
      End: found.length - 1,
    };
    if (event.key === 'Enter' && found[active] !== undefined) onSelect(found[active]);
    else if (to[event.key] !== undefined) move(to[event.key]!);
    else return;
    event.preventDefault();
  };

  return (
    <>
      <input
        type="search"
        aria-label="Search cameras by name"
        placeholder={`Search ${counted(table.count, 'camera')}`}
        value={search}
        onInput={(event) => {
          setSearch(event.currentTarget.value);
          setActive(0);
          list.current!.scrollTop = 0;
        }}
      />
      <div
        ref={list}
        class="camera-list"
        role="listbox"
        aria-label="Cameras"
        tabIndex={0}
        aria-activedescendant={found.length > 0 ? `camera-${found[active]}` : undefined}
        onScroll={measure}
        onKeyDown={onKeyDown}
      >
        <div role="presentation" style={{ height: `${found.length * ROW_PX}px`, position: 'relative' }}>
          {found.slice(first, last).map((camera, i) => {
            const state = stateOfCamera(table, camera);
            const row = first + i;
            return (
              <div
                key={camera}
                id={`camera-${camera}`}
                role="option"
                aria-selected={row === active}
                aria-posinset={row + 1}
                aria-setsize={found.length}
                class="camera-row"
                style={{ top: `${row * ROW_PX}px`, height: `${ROW_PX}px` }}
                onClick={() => onSelect(camera)}
              >
                <StateDot state={state} />
                <span class="camera-name">{table.names[camera]}</span>
                <span class="muted small">
                  {table.sequences[camera]! > 0 ? `#${table.sequences[camera]}` : STATE_WORDS[state]}
                </span>
              </div>
            );
          })}
        </div>
      </div>
    </>
  );
}

function neighboursOf(incidence: Int32Array | null, camera: number): number[] {
  const found = new Set<number>();
  for (let i = 0; incidence !== null && i < incidence.length; i += 2) {
    if (incidence[i] === camera) found.add(incidence[i + 1]!);
  }
  return [...found].sort((a, b) => a - b);
}

function Stages({ seconds }: { seconds: Record<string, number> }) {
  const known = STAGES.filter((stage) => (seconds[stage] ?? 0) > 0);
  const longest = Math.max(...known.map((stage) => seconds[stage]!), 1e-9);
  return (
    <table class="stages">
      <caption class="visually-hidden">Time of each stage</caption>
      <tbody>
        {known.map((stage) => (
          <tr key={stage}>
            <th scope="row">{stage}</th>
            <td>
              <span class="bar" style={{ width: `${(100 * seconds[stage]!) / longest}%` }} />
            </td>
            <td class="number">{duration(seconds[stage]!)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function parseReport(camera: Camera): Record<string, unknown> {
  try {
    return JSON.parse(camera.reportJson || '{}') as Record<string, unknown>;
  } catch {
    return {};
  }
}

function CameraDetails({ store, table, selected, onSelect }: Props & { table: CameraTable }) {
  const [camera, setCamera] = useState<Camera | null>(null);
  const [photoFailed, setPhotoFailed] = useState(false);
  const back = useRef<HTMLButtonElement>(null);
  useEffect(() => {
    let closed = false;
    void store.camera(selected).then((answer) => !closed && setCamera(answer));
    return () => void (closed = true);
  }, [store, selected, table]);
  useEffect(() => {
    setPhotoFailed(false);
    back.current?.focus({ preventScroll: true });
    store.watchIncidence(true);
  }, [selected]);

  const state = stateOfCamera(table, selected);
  const sequence = table.sequences[selected]!;
  const shares = table.shares.subarray(SHARES * selected, SHARES * (selected + 1));
  const neighbours = neighboursOf(store.incidence.value, selected);
  const name = table.names[selected]!;
  const report = camera?.index === selected ? parseReport(camera) : {};
  const numbers: [string, string][] = [
    ['Covered before', percent(shares[0]!)],
    ['Grown', percent(shares[1]!)],
    ['Filtered', percent(shares[2]!)],
    ['Accepted', percent(shares[3]!)],
  ];
  if (typeof report.seeds === 'number') numbers.push(['Seeds', count(report.seeds)]);
  if (typeof report.tentative_patches_scored === 'number') {
    numbers.push(['Patches scored', count(report.tentative_patches_scored)]);
  }
  if (table.acceptedPatches[selected]! > 0) numbers.push(['Patches accepted', count(table.acceptedPatches[selected]!)]);
  if (camera?.index === selected && camera.attempts) numbers.push(['Attempts', count(camera.attempts)]);
  return (
    <div class="camera-details">
      <div class="camera-head">
        <button ref={back} class="button small icon" onClick={() => onSelect(-1)} aria-label="Back to all cameras">
          ←
        </button>
        <h2>{name}</h2>
      </div>
      <div class="photo">
        {photoFailed ? (
          <p class="muted small">The photograph cannot be shown</p>
        ) : (
          <img
            key={selected}
            src={reconstructionUrl(store.id, `/cameras/${selected}/photo?width=640`)}
            alt={`Photograph ${name}`}
            onError={() => setPhotoFailed(true)}
          />
        )}
      </div>
      <p class="camera-state">
        <StateDot state={state} />
        {STATE_WORDS[state]}
        {sequence > 0 && <span class="muted">, number {sequence} in the order</span>}
        {camera?.index === selected && camera.worker && <span class="muted">, {camera.worker}</span>}
      </p>
      {camera?.index === selected && camera.skipReason && <Notice tone="danger">{camera.skipReason}</Notice>}
      <dl class="facts tight">
        {numbers.map(([key, value]) => (
          <div key={key}>
            <dt>{key}</dt>
            <dd>{value}</dd>
          </div>
        ))}
      </dl>
      <p class="muted small">Percentages are of the rays through the photograph’s lattice.</p>
      {camera?.index === selected && camera.seconds && <Stages seconds={camera.seconds} />}
      {neighbours.length > 0 && (
        <>
          <h3>Neighbours</h3>
          <ul class="chips">
            {neighbours.slice(0, 40).map((other) => (
              <li key={other}>
                <button onClick={() => onSelect(other)}>
                  <StateDot state={stateOfCamera(table, other)} />
                  {table.names[other] ?? other}
                </button>
              </li>
            ))}
          </ul>
        </>
      )}
      {state === 'COMMITTED' && table.acceptedPatches[selected]! > 0 && (
        <a
          class="button small"
          href={reconstructionUrl(store.id, `/parts/${sequence}`)}
          download={`${store.id}-${sequence}.ply`}
        >
          Download its surface, PLY
        </a>
      )}
    </div>
  );
}

export function CameraPanel(props: Props) {
  const table = props.store.cameras.value;
  return (
    <section class="card cameras" aria-label="Cameras">
      {table === null || table.count === 0 ? (
        <p class="muted">Cameras appear once the scene has been checked.</p>
      ) : props.selected >= 0 && props.selected < table.count ? (
        <CameraDetails {...props} table={table} />
      ) : (
        <CameraList table={table} onSelect={props.onSelect} />
      )}
    </section>
  );
}
