// SPDX-License-Identifier: Apache-2.0
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { EventStream, retryDelayMs, type ConnectionState, type ServerEvent } from './event_stream';

// A server whose connections the test writes to and breaks.
class FakeServer {
  requests: { lastEventId: string | null }[] = [];
  private streams: ReadableStreamDefaultController<Uint8Array>[] = [];
  status = 200;
  headers: Record<string, string> = {};

  fetch = (async (_url: string, init: RequestInit) => {
    this.requests.push({ lastEventId: new Headers(init.headers).get('Last-Event-ID') });
    if (this.status !== 200) return new Response('', { status: this.status, headers: this.headers });
    const body = new ReadableStream<Uint8Array>({
      start: (controller) => {
        this.streams.push(controller);
        init.signal?.addEventListener('abort', () => {
          try {
            controller.error(new Error('aborted'));
          } catch {
            // closed before
          }
        });
      },
    });
    return new Response(body, { status: 200 });
  }) as typeof fetch;

  send(text: string) {
    this.streams.at(-1)!.enqueue(new TextEncoder().encode(text));
  }
  end() {
    this.streams.at(-1)!.close();
  }
}

const settle = () => vi.advanceTimersByTimeAsync(0);

describe('EventStream', () => {
  let server: FakeServer;
  let events: ServerEvent[];
  let states: ConnectionState[];
  let stream: EventStream;

  beforeEach(() => {
    vi.useFakeTimers();
    server = new FakeServer();
    events = [];
    states = [];
  });
  afterEach(() => {
    stream.close();
    vi.useRealTimers();
  });
  const open = () => {
    stream = new EventStream({
      url: '/events',
      fetch: server.fetch,
      random: () => 1,
      silenceMs: 10_000,
      onEvent: (event) => events.push(event),
      onState: (state) => states.push(state),
    });
    return settle();
  };

  it('hands events on, however the bytes are cut', async () => {
    await open();
    for (const piece of ['id: 1\nevent: pa', 'rt\ndata: {"a"', ':1}\n', '\n: heartbeat\n\n', 'data: x\n\n']) {
      server.send(piece);
      await settle();
    }
    expect(events).toEqual([
      { event: 'part', data: '{"a":1}' },
      { event: 'message', data: 'x' },
    ]);
  });

  it('comes back after a broken connection and says what it saw last', async () => {
    await open();
    server.send('id: 17\ndata: a\n\n');
    await settle();
    server.end();
    await settle();
    expect(states).toEqual(['connecting', 'live', 'waiting']);
    await vi.advanceTimersByTimeAsync(500);
    expect(states.slice(3)).toEqual(['connecting', 'live']);
    expect(server.requests.map((request) => request.lastEventId)).toEqual([null, '17']);
    server.send('id: 18\ndata: b\n\n');
    await settle();
    expect(events.map((event) => event.data)).toEqual(['a', 'b']);
  });

  it('waits longer each time, and short again after a success', async () => {
    server.status = 502;
    await open();
    await vi.advanceTimersByTimeAsync(499);
    expect(server.requests).toHaveLength(1);
    await vi.advanceTimersByTimeAsync(1);
    expect(server.requests).toHaveLength(2);
    await vi.advanceTimersByTimeAsync(999);
    expect(server.requests).toHaveLength(2);
    server.status = 200;
    await vi.advanceTimersByTimeAsync(1);
    server.send('data: a\n\n');
    await settle();
    server.end();
    await vi.advanceTimersByTimeAsync(500);
    expect(server.requests).toHaveLength(4);
  });

  it('does not come back earlier than the server asks for', async () => {
    server.status = 503;
    server.headers = { 'Retry-After': '7' };
    await open();
    await vi.advanceTimersByTimeAsync(6999);
    expect(server.requests).toHaveLength(1);
    await vi.advanceTimersByTimeAsync(1);
    expect(server.requests).toHaveLength(2);
  });

  it('takes a silent connection for dead, but not one with heartbeats', async () => {
    await open();
    for (let i = 0; i < 5; ++i) {
      await vi.advanceTimersByTimeAsync(8000);
      server.send(': heartbeat\n\n');
      await settle();
    }
    expect(server.requests).toHaveLength(1);
    await vi.advanceTimersByTimeAsync(10_000 + 500);
    expect(server.requests).toHaveLength(2);
  });

  it('stays away when the server says that it was the end', async () => {
    await open();
    server.send('event: end\ndata: {}\n\n');
    await settle();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(server.requests).toHaveLength(1);
    expect(states.at(-1)).toBe('closed');
  });

  it('stays away from what is gone, and when it is closed', async () => {
    server.status = 404;
    await open();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(server.requests).toHaveLength(1);
    expect(states.at(-1)).toBe('closed');
    server.status = 200;
    await open();
    stream.close();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(server.requests).toHaveLength(2);
  });
});

describe('retryDelayMs', () => {
  it('never exceeds half a minute unless the server asks for more, and is never shorter than half its ceiling', () => {
    for (let attempt = 1; attempt < 100; ++attempt) {
      for (const random of [0, 0.3, 1]) {
        const delay = retryDelayMs(attempt, random);
        expect(delay).toBeLessThanOrEqual(30_000);
        expect(delay).toBeGreaterThanOrEqual(250);
        expect(retryDelayMs(attempt, random, 60_000)).toBe(60_000);
      }
    }
  });
});
