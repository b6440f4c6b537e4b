// SPDX-License-Identifier: Apache-2.0
// Which cameras are compared with which: row r, column t. Rows of processed cameras fade.
import { useEffect, useRef, useState } from 'preact/hooks';
import type { CameraTable } from '../api/camera_table';
import { Card } from '../components/pieces';
import { useVisible, useWidth } from '../components/hooks';
import { count } from '../format';
import type { ReconstructionStore } from '../state/reconstruction_store';
import { cssColor, theme } from '../theme';
import { prepareCanvas } from './canvas';

const LARGEST_PX = 480;
const FADED = 0.28;

// Pairs per cell of a picture of cells x cells, those of processed rows counting less, in units of the fullest cell.
export function shade(pairs: Int32Array, table: CameraTable, cells: number): Float32Array {
  const sums = new Float32Array(cells * cells);
  const scale = cells / table.count;
  let most = 0;
  for (let i = 0; i < pairs.length; i += 2) {
    const reference = pairs[i]!;
    if (reference >= table.count || pairs[i + 1]! >= table.count) continue;
    const cell = Math.floor(reference * scale) * cells + Math.floor(pairs[i + 1]! * scale);
    sums[cell]! += table.states[reference]! >= 2 ? FADED : 1;
    most = Math.max(most, sums[cell]!);
  }
  // Most cells hold few pairs; the root keeps them visible.
  if (most > 0) sums.forEach((sum, i) => (sums[i] = Math.sqrt(sum / most)));
  return sums;
}

function parseColor(text: string): [number, number, number] {
  const value = parseInt(text.slice(1), 16);
  return [value >> 16, (value >> 8) & 255, value & 255];
}

function paint(canvas: HTMLCanvasElement, pairs: Int32Array, table: CameraTable, size: number) {
  const context = prepareCanvas(canvas, size, size);
  const cells = Math.min(table.count, size);
  const shades = shade(pairs, table, cells);
  const [from, to] = [parseColor(cssColor('--surface-2')), parseColor(cssColor('--accent'))];
  const image = new ImageData(cells, cells);
  shades.forEach((share, i) => {
    for (let k = 0; k < 3; ++k) image.data[4 * i + k] = from[k]! + (to[k]! - from[k]!) * share;
    image.data[4 * i + 3] = 255;
  });
  const small = new OffscreenCanvas(cells, cells);
  small.getContext('2d')!.putImageData(image, 0, 0);
  context.imageSmoothingEnabled = false;
  context.drawImage(small, 0, 0, size, size);
}

export function IncidenceCard({ store, onSelect }: { store: ReconstructionStore; onSelect: (camera: number) => void }) {
  const box = useRef<HTMLDivElement>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  const width = useWidth(box);
  const visible = useVisible(box);
  const [hovered, setHovered] = useState('');
  const pairs = store.incidence.value;
  const table = store.cameras.value;
  const size = Math.min(width, LARGEST_PX);
  useEffect(() => store.watchIncidence(visible), [visible]);
  useEffect(() => {
    if (size === 0 || pairs === null || table === null || table.count === 0 || !visible) return;
    paint(canvas.current!, pairs, table, size);
  }, [pairs, table, size, visible, theme.value]);

  const cameraAt = (offset: number) =>
    Math.min(table!.count - 1, Math.max(0, Math.floor((offset / size) * table!.count)));
  const known = pairs !== null && table !== null && table.count > 0;
  const words = known ? `${count(pairs.length / 2)} pairs so far` : 'no pairs yet';
  return (
    <Card title="Camera incidence" note={words} class="incidence">
      <div ref={box}>
        <canvas
          ref={canvas}
          style={{ width: `${size}px`, height: `${size}px` }}
          role="img"
          aria-label={`Camera incidence matrix: ${words}. Rows of processed cameras are faded.`}
          onMouseMove={(event) => {
            if (!known) return;
            setHovered(`${table.names[cameraAt(event.offsetY)]} with ${table.names[cameraAt(event.offsetX)]}`);
          }}
          onMouseLeave={() => setHovered('')}
          onClick={(event) => known && onSelect(cameraAt(event.offsetY))}
        />
        <p class="muted small">
          {hovered || 'Row: the reference camera. Column: what it is compared with. Processed rows fade.'}
        </p>
      </div>
    </Card>
  );
}
