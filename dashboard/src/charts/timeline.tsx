// SPDX-License-Identifier: Apache-2.0
// Who had which camera when: one row a worker, one bar an attempt; what went wrong stands out.
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import type { Attempt, AttemptEnding } from '../api/types';
import { Card, Segmented } from '../components/pieces';
import { useNow, useWidth } from '../components/hooks';
import { clock, duration } from '../format';
import type { ReconstructionStore } from '../state/reconstruction_store';
import { cssColor, theme } from '../theme';
import { prepareCanvas } from './canvas';

const ROW_PX = 26;
const AXIS_PX = 22;
const LABEL_PX = 110;
const RANGES = [
  ['all', 'All'],
  ['600', '10 min'],
  ['60', '1 min'],
] as const;
const ENDINGS: Record<AttemptEnding, [words: string, color: string]> = {
  UNSPECIFIED: ['under way', '--state-assigned'],
  FINISHED: ['finished', '--state-committed'],
  FAILED: ['failed', '--state-skipped'],
  OUT_OF_MEMORY: ['out of memory', '--state-skipped'],
  LOST: ['lease lost', '--state-lost'],
  RELEASED: ['released', '--state-waiting'],
};

const isTrouble = (ending: AttemptEnding) => ending === 'FAILED' || ending === 'OUT_OF_MEMORY' || ending === 'LOST';

interface Bar {
  attempt: Attempt;
  ending: AttemptEnding;
  row: number;
  begin: number; // ms
  end: number; // ms; Infinity while it lasts
}

export function layOut(attempts: readonly Attempt[]): { workers: string[]; bars: Bar[] } {
  const workers = [...new Set(attempts.map((attempt) => attempt.worker))].sort((a, b) =>
    a.localeCompare(b, 'en', { numeric: true }),
  );
  const rows = new Map(workers.map((worker, row) => [worker, row]));
  const bars = attempts.map((attempt) => ({
    attempt,
    ending: attempt.ending.replace('ATTEMPT_ENDING_', '') as AttemptEnding,
    row: rows.get(attempt.worker)!,
    begin: Date.parse(attempt.beginTime),
    end: attempt.endTime ? Date.parse(attempt.endTime) : Infinity,
  }));
  return { workers, bars };
}

function ticks(begin: number, end: number, most: number): number[] {
  const steps = [1, 2, 5, 10, 30, 60, 120, 300, 600, 1800, 3600, 7200, 21600, 86400].map((seconds) => 1000 * seconds);
  const step = steps.find((candidate) => (end - begin) / candidate <= most) ?? 7 * 86_400_000;
  const found: number[] = [];
  for (let at = Math.ceil(begin / step) * step; at < end; at += step) found.push(at);
  return found;
}

interface Axes {
  begin: number; // ms
  end: number; // ms
  labels: number; // px, width of the column with the workers' names
  x: (time: number) => number; // px
}

function drawTimeline(
  context: CanvasRenderingContext2D,
  workers: readonly string[],
  bars: readonly Bar[],
  { begin, end, labels, x }: Axes,
  width: number,
  height: number,
) {
  const colors = Object.fromEntries(
    Object.entries(ENDINGS).map(([ending, [, name]]) => [ending, cssColor(name)]),
  ) as Record<AttemptEnding, string>;
  context.font = `12px ${cssColor('--font')}`;
  context.textBaseline = 'middle';
  context.fillStyle = cssColor('--text-2');
  context.strokeStyle = cssColor('--line');
  if (bars.length === 0) return;
  for (const at of ticks(begin, end, Math.max(2, (width - labels) / 90))) {
    context.beginPath();
    context.moveTo(x(at) + 0.5, 0);
    context.lineTo(x(at) + 0.5, height - AXIS_PX);
    context.stroke();
    context.fillText(clock(new Date(at).toISOString()), Math.min(x(at), width - 52), height - AXIS_PX / 2 + 2);
  }
  context.save();
  context.beginPath();
  context.rect(0, 0, labels - 8, height);
  context.clip();
  workers.forEach((worker, row) => context.fillText(worker, 0, (row + 0.5) * ROW_PX));
  context.restore();
  for (const bar of bars) {
    if (bar.end < begin) continue;
    const left = x(Math.max(bar.begin, begin));
    const wide = Math.max(x(bar.end) - left - 0.7, 1.2);
    const bad = isTrouble(bar.ending);
    context.fillStyle = colors[bar.ending];
    context.fillRect(left, bar.row * ROW_PX + 4, bad ? Math.max(wide, 3) : wide, ROW_PX - 8);
    if (bar.ending === 'LOST') {
      // Not by colour alone.
      context.fillStyle = cssColor('--surface');
      context.fillRect(left, bar.row * ROW_PX + ROW_PX / 2 - 1.5, Math.max(wide, 3), 3);
    }
  }
}

interface TroublesProps {
  troubles: readonly Bar[];
  nameOf: (camera: number) => string;
  onSelect: (camera: number) => void;
}

function Troubles({ troubles, nameOf, onSelect }: TroublesProps) {
  return (
    <details class="troubles">
      <summary>What failed or was lost</summary>
      <div class="table-wrap">
        <table class="small">
          <thead>
            <tr>
              <th>When</th>
              <th>Camera</th>
              <th>Worker</th>
              <th>Ending</th>
              <th>Reason</th>
            </tr>
          </thead>
          <tbody>
            {troubles.slice(-100).map(({ attempt, ending }) => (
              <tr key={`${attempt.sequence}-${attempt.beginTime}`}>
                <td>{clock(attempt.beginTime)}</td>
                <td>
                  <button class="link" onClick={() => onSelect(attempt.camera)}>
                    {nameOf(attempt.camera)}
                  </button>
                </td>
                <td>{attempt.worker}</td>
                <td>{ENDINGS[ending][0]}</td>
                <td>{attempt.reason}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </details>
  );
}

export function TimelineCard({ store, onSelect }: { store: ReconstructionStore; onSelect: (camera: number) => void }) {
  const box = useRef<HTMLDivElement>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  const width = useWidth(box);
  const [range, setRange] = useState<'all' | '600' | '60'>('all');
  const [hovered, setHovered] = useState<{ bar: Bar; x: number; y: number } | null>(null);
  const attempts = store.attempts.value;
  const { workers, bars } = useMemo(() => layOut(attempts), [attempts]);
  const running = bars.some((bar) => bar.end === Infinity);
  const now = useNow(running ? 1000 : 60_000);

  const last = running ? now : bars.reduce((latest, bar) => Math.max(latest, bar.end), 0);
  const first = bars.reduce((earliest, bar) => Math.min(earliest, bar.begin), last);
  const begin = range === 'all' ? first : Math.max(first, last - 1000 * Number(range));
  const end = Math.max(last, begin + 1000);
  const labels = width > 560 ? LABEL_PX : 64;
  const x = (time: number) => labels + ((Math.min(time, end) - begin) / (end - begin)) * (width - labels - 1);
  const height = workers.length * ROW_PX + AXIS_PX;

  useEffect(() => {
    if (width === 0 || canvas.current === null) return;
    drawTimeline(prepareCanvas(canvas.current, width, height), workers, bars, { begin, end, labels, x }, width, height);
  }, [bars, width, height, begin, end, theme.value]);

  const barAt = (event: MouseEvent): Bar | null => {
    const bounds = canvas.current!.getBoundingClientRect();
    const [px, py] = [event.clientX - bounds.left, event.clientY - bounds.top];
    const row = Math.floor(py / ROW_PX);
    // Later bars lie on top.
    return bars.findLast((bar) => bar.row === row && x(bar.begin) - 2 <= px && px <= x(bar.end) + 2) ?? null;
  };
  const hover = (event: MouseEvent) => {
    const bar = barAt(event);
    const bounds = canvas.current!.getBoundingClientRect();
    setHovered(bar === null ? null : { bar, x: event.clientX - bounds.left, y: event.clientY - bounds.top });
  };
  const name = (camera: number) => store.cameras.value?.names[camera] ?? `camera ${camera}`;
  const troubles = bars.filter((bar) => isTrouble(bar.ending));
  const words =
    bars.length === 0
      ? 'no camera has been handed out yet'
      : `${bars.length} attempts on ${workers.length} workers, ` +
        (troubles.length === 0 ? 'none failed or lost' : `${troubles.length} failed or lost`);

  return (
    <Card
      title="Camera jobs per worker"
      note={words}
      tools={<Segmented label="Time" value={range} options={RANGES} onChange={setRange} />}
    >
      <div class="timeline" ref={box}>
        <canvas
          ref={canvas}
          role="img"
          aria-label={`Timeline of camera jobs: ${words}`}
          onMouseMove={hover}
          onMouseLeave={() => setHovered(null)}
          onClick={(event) => {
            const bar = barAt(event);
            if (bar !== null) onSelect(bar.attempt.camera);
          }}
        />
        {hovered !== null && (
          <div
            class="tooltip"
            style={{ left: `${Math.min(hovered.x + 12, width - 230)}px`, top: `${hovered.y + 14}px` }}
          >
            <strong>{name(hovered.bar.attempt.camera)}</strong>, number {hovered.bar.attempt.sequence}
            <br />
            {ENDINGS[hovered.bar.ending][0]} at {hovered.bar.attempt.worker},{' '}
            {duration((Math.min(hovered.bar.end, now) - hovered.bar.begin) / 1000)}
            {hovered.bar.attempt.reason && <div class="muted">{hovered.bar.attempt.reason}</div>}
          </div>
        )}
      </div>
      <ul class="legend">
        {Object.values(ENDINGS).map(([words, color]) => (
          <li key={words}>
            <span class="dot square" style={{ background: `var(${color})` }} />
            {words}
          </li>
        ))}
      </ul>
      {troubles.length > 0 && <Troubles troubles={troubles} nameOf={name} onSelect={onSelect} />}
    </Card>
  );
}
