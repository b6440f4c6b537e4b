// SPDX-License-Identifier: Apache-2.0
// Fetches what is large and turns it into columns and buffers, so that the page's own thread never parses it.
import { decodePreview } from '../view3d/preview_decoder';
import { makeCameraTable } from './camera_table';
import { runs, type Attempt, type Camera } from './types';
import type { DataRequest, DataResponse } from './data_service';

const post = self.postMessage.bind(self) as (message: DataResponse, transfer: Transferable[]) => void;
// A chart shows no more, and no window is larger.
const MOST_ATTEMPTS = 20_000;
const MOST_RUNNING = 1000;
const cancelled = new Map<number, AbortController>();

async function get(url: string, signal: AbortSignal): Promise<Response> {
  const response = await fetch(url, { signal });
  if (!response.ok) throw Object.assign(new Error(`status ${response.status}`), { status: response.status });
  return response;
}

// The cameras as they were said last, for whoever asks for all of one.
let lastCameras: Camera[] = [];

// At most `most` of them, the last one that began at the end; those that run are always among them.
async function attemptsAt(url: string, most: number, signal: AbortSignal): Promise<Attempt[]> {
  const response = await get(`${url}/attempts?maxAttempts=${most}`, signal);
  const json = (await response.json()) as { attempts?: Attempt[] };
  // The job that estimates cameras is of none of them.
  return (json.attempts ?? []).filter(({ camera }) => camera >= 0).reverse();
}

async function answer(request: DataRequest, signal: AbortSignal): Promise<[unknown, Transferable[]]> {
  switch (request.kind) {
    case 'cameras': {
      const json = (await (await get(request.url, signal)).json()) as { cameras?: Camera[] };
      lastCameras = json.cameras ?? [];
      return [makeCameraTable(lastCameras), []];
    }
    case 'camera':
      return [lastCameras[request.index] ?? null, []];
    case 'incidence': {
      const json = (await (await get(request.url, signal)).json()) as {
        pairs?: { reference?: number; target?: number }[];
      };
      const pairs = json.pairs ?? [];
      const columns = new Int32Array(2 * pairs.length);
      pairs.forEach(({ reference = 0, target = 0 }, i) => columns.set([reference, target], 2 * i));
      return [columns, [columns.buffer]];
    }
    case 'attempts':
      return [await attemptsAt(request.url, MOST_ATTEMPTS, signal), []];
    case 'held':
      return [(await attemptsAt(request.url, MOST_RUNNING, signal)).filter(runs), []];
    case 'preview': {
      const part = decodePreview(await (await get(request.url, signal)).arrayBuffer());
      return [part, [part.positions.buffer, part.normals.buffer, part.colors.buffer, part.indices.buffer]];
    }
  }
}

self.onmessage = async ({ data }: MessageEvent<DataRequest | { cancel: number }>) => {
  if ('cancel' in data) return cancelled.get(data.cancel)?.abort();
  const abort = new AbortController();
  cancelled.set(data.id, abort);
  try {
    const [value, transfer] = await answer(data, abort.signal);
    post({ id: data.id, value }, transfer);
  } catch (error) {
    const { message, status } = error as Error & { status?: number };
    post({ id: data.id, error: message, status: status ?? 0 }, []);
  } finally {
    cancelled.delete(data.id);
  }
};
