// SPDX-License-Identifier: Apache-2.0
// The paper's figure 7: what share of each camera's rays was grown and meshed, in the order of processing.
import { useEffect, useRef } from 'preact/hooks';
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import { SHARES, type CameraTable } from '../api/camera_table';
import { Card } from '../components/pieces';
import { useWidth } from '../components/hooks';
import { percent } from '../format';
import type { ReconstructionStore } from '../state/reconstruction_store';
import { cssColor, theme } from '../theme';

export interface Shares {
  sequences: number[];
  cameras: number[];
  grown: (number | null)[];
  meshed: (number | null)[];
}

export function sharesInOrder(table: CameraTable): Shares {
  const order: number[] = [];
  for (let i = 0; i < table.count; ++i) {
    if (table.sequences[i]! > 0 && !Number.isNaN(table.shares[SHARES * i + 1]!)) order.push(i);
  }
  order.sort((a, b) => table.sequences[a]! - table.sequences[b]!);
  const share = (camera: number, which: number) => {
    const value = table.shares[SHARES * camera + which]!;
    return Number.isNaN(value) ? null : 100 * value;
  };
  return {
    sequences: order.map((camera) => table.sequences[camera]!),
    cameras: order,
    grown: order.map((camera) => share(camera, 1)),
    meshed: order.map((camera) => share(camera, 3)),
  };
}

function mean(values: readonly (number | null)[]): number {
  const known = values.filter((value) => value !== null);
  return known.length === 0 ? NaN : known.reduce((sum, value) => sum + value, 0) / known.length / 100;
}

function makePlot(parent: HTMLElement, width: number, onClick: (index: number) => void): uPlot {
  const axis = { stroke: cssColor('--text-2'), grid: { stroke: cssColor('--line'), width: 1 }, ticks: { show: false } };
  const series = (label: string, color: string) => ({
    label,
    stroke: cssColor(color),
    width: 1.6,
    points: { show: false },
    value: (_: uPlot, value: number | null) => (value === null ? '–' : `${value.toFixed(1)} %`),
  });
  const plot = new uPlot(
    {
      width,
      height: 220,
      scales: { x: { time: false }, y: { range: [0, 100] } },
      axes: [
        { ...axis, size: 30, incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000] },
        { ...axis, size: 46, values: (_, values) => values.map((value) => `${value} %`) },
      ],
      series: [{ label: 'Camera' }, series('Grown', '--series-1'), series('Meshed', '--series-2')],
      cursor: { drag: { x: true, y: false } },
    },
    [[], [], []],
    parent,
  );
  plot.over.addEventListener('click', () => {
    if (plot.cursor.idx !== null && plot.cursor.idx !== undefined) onClick(plot.cursor.idx);
  });
  return plot;
}

export function SharesCard({ store, onSelect }: { store: ReconstructionStore; onSelect: (camera: number) => void }) {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const shares = useRef<Shares | null>(null);
  const width = useWidth(box);
  const table = store.cameras.value;
  const now = table === null ? null : sharesInOrder(table);
  shares.current = now;

  useEffect(() => {
    if (width === 0) return;
    const made = makePlot(box.current!, width, (index) => onSelect(shares.current?.cameras[index] ?? -1));
    plot.current = made;
    return () => {
      plot.current = null;
      made.destroy();
    };
  }, [width, theme.value]);
  useEffect(() => {
    if (now !== null) plot.current?.setData([now.sequences, now.grown, now.meshed]);
  }, [table, width, theme.value]);

  const words =
    now === null || now.sequences.length === 0
      ? 'no camera has been processed yet'
      : `mean of ${now.sequences.length} cameras: ${percent(mean(now.grown))} grown, ${percent(mean(now.meshed))} meshed`;
  return (
    <Card title="Shares of rays in order of processing" note={words}>
      <div
        class="shares"
        ref={box}
        role="img"
        aria-label={`Growing and meshing shares per camera in the order of processing, ${words}`}
      />
    </Card>
  );
}
