// SPDX-License-Identifier: Apache-2.0
// Server-sent events over fetch, reconnecting by itself. EventSource is not used as it gives up for good after any
// answer other than 200 (a coordinator that restarts behind a proxy answers 502), hides heartbeats, and so cannot tell
// a quiet stream from a dead one.
import { createParser } from 'eventsource-parser';

export type ConnectionState = 'connecting' | 'live' | 'waiting' | 'closed';

export interface ServerEvent {
  event: string;
  data: string;
}

export interface EventStreamOptions {
  url: string;
  onEvent: (event: ServerEvent) => void;
  // Whoever gets `live` after the first time may have missed what the server no longer remembers, and asks again.
  onState: (state: ConnectionState, retryInMs: number) => void;
  // Nothing, not even a heartbeat, for so long: the connection counts as dead.
  silenceMs?: number;
  fetch?: typeof fetch;
  random?: () => number;
}

const FIRST_RETRY_MS = 500;
const LONGEST_RETRY_MS = 30_000;

// Before attempt 1, 2, 3 ... since the last success: doubling, half of it drawn so that many pages do not come back at
// once. `serverMs` is what the server asked for (Retry-After, or retry: in the stream), and is never undercut.
export function retryDelayMs(attempt: number, random: number, serverMs = 0): number {
  const ceiling = Math.min(LONGEST_RETRY_MS, FIRST_RETRY_MS * 2 ** Math.min(attempt - 1, 16));
  return Math.max(serverMs, ceiling * (0.5 + 0.5 * random));
}

export class EventStream {
  private readonly fetch: typeof fetch;
  private readonly random: () => number;
  private readonly silenceMs: number;
  private abort = new AbortController();
  private retryTimer: ReturnType<typeof setTimeout> | undefined;
  private silenceTimer: ReturnType<typeof setTimeout> | undefined;
  private lastEventId = '';
  private serverRetryMs = 0;
  private failures = 0;
  private closed = false;

  constructor(private readonly options: EventStreamOptions) {
    this.fetch = options.fetch ?? ((...args) => fetch(...args));
    this.random = options.random ?? Math.random;
    this.silenceMs = options.silenceMs ?? 45_000;
    void this.connect();
  }

  close() {
    if (this.closed) return;
    this.closed = true;
    clearTimeout(this.retryTimer);
    clearTimeout(this.silenceTimer);
    this.abort.abort();
    this.options.onState('closed', 0);
  }

  // At once, for somebody who knows that the network is back.
  retryNow() {
    if (this.closed || this.retryTimer === undefined) return;
    clearTimeout(this.retryTimer);
    this.retryTimer = undefined;
    void this.connect();
  }

  private async connect() {
    this.options.onState('connecting', 0);
    const abort = new AbortController();
    this.abort = abort;
    this.listenForSilence();
    let retryAfterMs = 0;
    try {
      const headers: Record<string, string> = { Accept: 'text/event-stream' };
      if (this.lastEventId !== '') headers['Last-Event-ID'] = this.lastEventId;
      const response = await this.fetch(this.options.url, { headers, signal: abort.signal, cache: 'no-store' });
      if (!response.ok || response.body === null) {
        retryAfterMs = 1000 * (Number(response.headers.get('Retry-After')) || 0);
        // Gone for good: asking again does not help.
        if (response.status === 404) return this.close();
        throw new Error(`status ${response.status}`);
      }
      this.options.onState('live', 0);
      await this.read(response.body);
    } catch {
      // Whatever broke it, the answer is the same.
    }
    clearTimeout(this.silenceTimer);
    abort.abort();
    if (this.closed) return;
    this.failures += 1;
    const delay = retryDelayMs(this.failures, this.random(), Math.max(retryAfterMs, this.serverRetryMs));
    this.options.onState('waiting', delay);
    this.retryTimer = setTimeout(() => this.retryNow(), delay);
  }

  private async read(body: ReadableStream<Uint8Array>) {
    const parser = createParser({
      onEvent: ({ id, event, data }) => {
        if (this.closed) return;
        if (id !== undefined) this.lastEventId = id;
        this.failures = 0;
        this.options.onEvent({ event: event ?? 'message', data });
        // The server has nothing more to say, ever.
        if (event === 'end') this.close();
      },
      onRetry: (ms) => (this.serverRetryMs = ms),
    });
    const reader = body.getReader();
    const decoder = new TextDecoder();
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      this.listenForSilence();
      parser.feed(decoder.decode(value, { stream: true }));
    }
  }

  private listenForSilence() {
    clearTimeout(this.silenceTimer);
    const abort = this.abort;
    this.silenceTimer = setTimeout(() => abort.abort(), this.silenceMs);
  }
}
