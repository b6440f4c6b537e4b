// SPDX-License-Identifier: Apache-2.0
// Everything the page knows about one reconstruction. Events say what is new; what is large is asked for again when an
// event has made it old and somebody looks at it.
import { signal } from '@preact/signals';
import type { CameraTable } from '../api/camera_table';
import { api, reconstructionUrl, tokenWanted } from '../api/client';
import { DataService } from '../api/data_service';
import { EventStream, type ConnectionState } from '../api/event_stream';
import {
  runs,
  type Attempt,
  type Camera,
  type LogEntry,
  type Part,
  type Reconstruction,
} from '../api/types';
import { firstInOrder } from './order';
import { Refresher } from './refresher';

const NOT_FOUND_PROBE_MS = 4000;

export class ReconstructionStore {
  readonly reconstruction = signal<Reconstruction | null>(null);
  readonly connection = signal<ConnectionState>('connecting');
  readonly missing = signal(false);
  readonly cameras = signal<CameraTable | null>(null);
  readonly parts = signal<readonly Part[]>([]); // in sequence
  readonly attempts = signal<readonly Attempt[]>([]);
  readonly incidence = signal<Int32Array | null>(null);
  readonly log = signal<readonly LogEntry[]>([]);
  readonly data = new DataService();

  private readonly stream: EventStream;
  private readonly refreshers: Record<'cameras' | 'attempts' | 'incidence' | 'log', Refresher>;
  private readonly watched = { cameras: true, attempts: true, incidence: false, log: true };
  private newParts: Part[] = [];
  private flushRequested = false;
  private readonly probe: ReturnType<typeof setTimeout>;

  constructor(readonly id: string) {
    const at = (rest: string) => reconstructionUrl(id, rest);
    this.refreshers = {
      cameras: new Refresher(async () => {
        this.cameras.value = await this.data.ask({ kind: 'cameras', url: at('/cameras') });
      }, 2000),
      attempts: new Refresher(async () => {
        this.attempts.value = await this.data.ask({ kind: 'attempts', url: at('') });
      }, 3000),
      incidence: new Refresher(async () => {
        this.incidence.value = await this.data.ask({ kind: 'incidence', url: at('/incidence') });
      }, 5000),
      log: new Refresher(async () => {
        this.log.value = await api.log(id);
      }, 3000),
    };
    this.stream = new EventStream({
      url: at('/events'),
      onState: (state) => {
        this.connection.value = state;
        if (state === 'closed' && this.reconstruction.value === null) this.missing.value = true;
      },
      onEvent: ({ event, data }) => {
        if (event === 'reconstruction') this.takeReconstruction(JSON.parse(data) as Reconstruction);
        if (event === 'part') this.takePart(JSON.parse(data) as Part);
      },
    });
    window.addEventListener('online', this.comeBack);
    document.addEventListener('visibilitychange', this.comeBack);
    // A stream that is refused says nothing of why.
    this.probe = setTimeout(() => void this.askWhy(), NOT_FOUND_PROBE_MS);
    this.refreshAll();
  }

  close() {
    clearTimeout(this.probe);
    window.removeEventListener('online', this.comeBack);
    document.removeEventListener('visibilitychange', this.comeBack);
    this.stream.close();
    for (const refresher of Object.values(this.refreshers)) refresher.close();
    this.data.close();
  }

  // The incidence matrix is large and seldom looked at.
  watchIncidence(watched: boolean) {
    this.watched.incidence = watched;
    if (watched) this.refreshers.incidence.request();
  }

  // The camera that the next commit waits for.
  firstHeld(): Attempt | null {
    return firstInOrder(this.attempts.value.filter(runs));
  }

  camera(index: number): Promise<Camera | null> {
    return this.data.ask({ kind: 'camera', index });
  }

  async cancel() {
    this.takeReconstruction(await api.cancel(this.id));
  }

  private readonly comeBack = () => {
    if (document.visibilityState === 'visible') this.stream.retryNow();
  };

  private async askWhy() {
    if (this.reconstruction.value !== null) return;
    const response = await fetch(reconstructionUrl(this.id)).catch(() => null);
    if (response?.status === 401) tokenWanted.value = true;
  }

  private refreshAll() {
    for (const name of ['cameras', 'attempts', 'incidence', 'log'] as const) {
      if (this.watched[name]) this.refreshers[name].request();
    }
  }

  private takeReconstruction(reconstruction: Reconstruction) {
    this.reconstruction.value = reconstruction;
    this.refreshAll();
  }

  private takePart(part: Part) {
    this.newParts.push(part);
    if (this.flushRequested) return;
    this.flushRequested = true;
    // Thousands come at once when the page is opened.
    setTimeout(() => {
      this.flushRequested = false;
      const known = this.parts.value.at(-1)?.sequence ?? 0;
      const fresh = this.newParts.filter((candidate) => candidate.sequence > known);
      this.newParts = [];
      if (fresh.length > 0) this.parts.value = [...this.parts.value, ...fresh];
    }, 50);
  }
}
