// SPDX-License-Identifier: Apache-2.0
// Decides what level of detail of which part is fetched next, and keeps few requests under way.
import type { DataService } from '../api/data_service';
import { ApiError } from '../api/client';
import { chooseFaceCaps, worthReplacing } from './level_of_detail';
import type { PartGeometry } from './preview_decoder';

export interface LoadedPart {
  sequence: number;
  camera: number;
  faces: number; // of the whole part; a guess until something of it was fetched
  shownCap: number; // 0: nothing is shown yet
  shownFaces: number;
  center: [number, number, number] | null;
  radius: number;
}

export interface PartLoaderOptions {
  data: DataService;
  urlOf: (sequence: number, maxFaces: number) => string;
  show: (part: LoadedPart, geometry: PartGeometry | null) => void;
  // How much of the screen it covers, in any unit, > 0. Asked only for parts with a centre.
  importanceOf: (part: LoadedPart) => number;
}

// Browsers open six connections to a server; the events, and what people click, need some.
const AT_THE_SAME_TIME = 4;
const FACES_PER_PATCH = 1.9;
const RETRY_MS = 5000;

export class PartLoader {
  readonly parts = new Map<number, LoadedPart>();
  private readonly abort = new AbortController();
  private wanted: { part: LoadedPart; cap: number }[] = [];
  private underWay = new Set<number>();
  private retryTimer: ReturnType<typeof setTimeout> | undefined;

  // `budget`: faces to show, at most.
  constructor(
    private readonly options: PartLoaderOptions,
    private budget: number,
  ) {}

  setBudget(budget: number) {
    if (budget === this.budget) return;
    this.budget = budget;
    this.plan();
  }

  add(parts: readonly { sequence: number; camera: number; patches: string }[]) {
    for (const { sequence, camera, patches } of parts) {
      if (this.parts.has(sequence)) continue;
      const faces = Math.round(Number(patches) * FACES_PER_PATCH);
      this.parts.set(sequence, { sequence, camera, faces, shownCap: 0, shownFaces: 0, center: null, radius: 0 });
    }
    this.plan();
  }

  // Triangles of everything accepted so far.
  get facesOfWhole(): number {
    let sum = 0;
    for (const part of this.parts.values()) sum += part.faces;
    return sum;
  }

  get complete(): boolean {
    return this.wanted.length === 0 && this.underWay.size === 0;
  }

  // Anew, as parts have come or the view has changed.
  plan() {
    const parts = [...this.parts.values()];
    const importance = parts.map((part) => (part.center === null ? NaN : this.options.importanceOf(part)));
    const known = importance.filter((value) => !Number.isNaN(value)).sort((a, b) => a - b);
    const median = known[known.length >> 1] ?? 1;
    const demands = parts.map((part, i) => ({
      faces: part.faces,
      // Unseen parts count as any other; nothing is left out altogether for being far away.
      importance: Math.max(Number.isNaN(importance[i]) ? median : importance[i]!, median / 64, 1e-9),
    }));
    const caps = chooseFaceCaps(demands, this.budget);
    // What is finer than wanted stays as long as there is room for everything that is wanted.
    let afterwards = 0;
    parts.forEach((part, i) => (afterwards += Math.max(part.shownFaces, Math.min(part.faces, caps[i]!))));
    const overBudget = afterwards > this.budget;

    this.wanted = [];
    parts.forEach((part, i) => {
      const cap = caps[i]!;
      if (this.underWay.has(part.sequence) || !worthReplacing(part.shownCap, cap, part.faces, overBudget)) return;
      if (cap === 0) this.drop(part);
      else this.wanted.push({ part, cap });
    });
    // Coarser ones first, as they make room; then what shows nothing yet; then the most important.
    const rank = ({ part, cap }: { part: LoadedPart; cap: number }) =>
      cap < part.shownCap ? 0 : part.shownCap === 0 ? 1 : 2;
    const weight = new Map(parts.map((part, i) => [part.sequence, demands[i]!.importance]));
    this.wanted.sort(
      (a, b) =>
        rank(b) - rank(a) ||
        weight.get(a.part.sequence)! - weight.get(b.part.sequence)! ||
        b.part.sequence - a.part.sequence,
    );
    this.pump();
  }

  close() {
    this.abort.abort();
    clearTimeout(this.retryTimer);
    this.wanted = [];
  }

  private drop(part: LoadedPart) {
    part.shownCap = 0;
    part.shownFaces = 0;
    this.options.show(part, null);
  }

  private pump() {
    while (this.underWay.size < AT_THE_SAME_TIME && !this.abort.signal.aborted) {
      const next = this.wanted.pop();
      if (next === undefined) return;
      this.underWay.add(next.part.sequence);
      void this.load(next.part, next.cap);
    }
  }

  private async load(part: LoadedPart, cap: number) {
    try {
      const url = this.options.urlOf(part.sequence, cap);
      const geometry = await this.options.data.ask({ kind: 'preview', url }, this.abort.signal);
      if (this.abort.signal.aborted) return;
      const faces = geometry.indices.length / 3;
      part.shownCap = cap;
      part.shownFaces = faces;
      part.faces = geometry.facesOfWhole;
      const [a, b] = [geometry.min, geometry.max];
      part.center = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2];
      part.radius = Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]) / 2;
      this.options.show(part, geometry);
    } catch (error) {
      // A part that is gone is gone; anything else may be better in a while.
      const gone = error instanceof ApiError && error.status >= 400 && error.status < 500;
      if (!gone && !this.abort.signal.aborted) {
        clearTimeout(this.retryTimer);
        this.retryTimer = setTimeout(() => this.plan(), RETRY_MS);
      }
    } finally {
      this.underWay.delete(part.sequence);
      this.pump();
    }
  }
}
