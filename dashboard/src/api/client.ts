// SPDX-License-Identifier: Apache-2.0
import { signal } from '@preact/signals';
import type { Format, LogEntry, Option, Preset, Problem, Reconstruction, SceneFile, Worker } from './types';

// The API lies beside the page, below whatever path a proxy puts both.
export function apiUrl(path: string): string {
  return new URL(`v1/${path}`, document.baseURI).href;
}

export function reconstructionUrl(id: string, rest = ''): string {
  return apiUrl(`reconstructions/${encodeURIComponent(id)}${rest}`);
}

export class ApiError extends Error {
  constructor(
    readonly status: number,
    message: string,
    readonly field = '',
  ) {
    super(message);
  }
}

// Set when the coordinator wants a token; the page asks for it.
export const tokenWanted = signal(false);

// With every request that changes something: other sites' pages cannot send it.
export const csrfHeader = { 'X-Meshwright-Csrf': '1' };

// Exchanges a key for a cookie that no script can read, as pictures and downloads cannot carry a header. False: the key
// is none.
export async function beginSession(key: string): Promise<boolean> {
  const headers = { ...csrfHeader, Authorization: `Bearer ${key.trim()}` };
  const response = await fetch(apiUrl('session'), { method: 'POST', headers }).catch(() => null);
  if (response?.ok) tokenWanted.value = false;
  return response?.ok ?? false;
}

// A share link carries its key behind "#key=", which browsers send nowhere.
export async function openSharedLink(): Promise<void> {
  const key = /^#key=([\w-]+)$/.exec(location.hash)?.[1];
  if (!key) return;
  history.replaceState(null, '', location.pathname + location.search);
  await beginSession(key);
}

export async function errorOf(response: Response): Promise<ApiError> {
  if (response.status === 401) tokenWanted.value = true;
  try {
    const problem = (await response.json()) as Problem;
    if (typeof problem.detail === 'string') return new ApiError(response.status, problem.detail, problem.field);
  } catch {
    // Not from the coordinator itself: a proxy, or nobody.
  }
  return new ApiError(response.status, `The coordinator answered ${response.status} ${response.statusText}`.trim());
}

async function call(path: string, init?: RequestInit): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(apiUrl(path), { ...init, headers: { ...csrfHeader, ...init?.headers } });
  } catch {
    throw new ApiError(0, 'The coordinator does not answer');
  }
  if (!response.ok) throw await errorOf(response);
  return response;
}

async function getJson<T>(path: string): Promise<T> {
  return (await (await call(path)).json()) as T;
}

async function postJson<T>(path: string, body?: unknown): Promise<T> {
  const init: RequestInit = { method: 'POST' };
  if (body !== undefined) {
    init.body = JSON.stringify(body);
    init.headers = { 'Content-Type': 'application/json' };
  }
  return (await (await call(path, init)).json()) as T;
}

const at = (id: string) => `reconstructions/${encodeURIComponent(id)}`;

export const api = {
  async listReconstructions(): Promise<Reconstruction[]> {
    const all: Reconstruction[] = [];
    let pageToken = '';
    do {
      const page = await getJson<{ reconstructions?: Reconstruction[]; nextPageToken?: string }>(
        `reconstructions?pageSize=500&pageToken=${encodeURIComponent(pageToken)}`,
      );
      all.push(...(page.reconstructions ?? []));
      pageToken = page.nextPageToken ?? '';
    } while (pageToken !== '');
    return all;
  },
  create: (request: { id: string; optionsJson: string; sceneReference: string; weight: number }) =>
    postJson<Reconstruction>('reconstructions', request),
  // Another one of the same photographs; nothing of them is uploaded again.
  createAgain: (from: string, request: { id: string; optionsJson: string; weight: number }) =>
    postJson<Reconstruction>(`${at(from)}:again`, request),
  reconstruction: (id: string) => getJson<Reconstruction>(at(id)),
  // Of the coordinates that surfaces are sent in, to those of the scene.
  offset: async (id: string) => (await getJson<{ offset?: number[] }>(`${at(id)}/parts`)).offset ?? [0, 0, 0],
  start: (id: string) => postJson<Reconstruction>(`${at(id)}:start`),
  cancel: (id: string) => postJson<Reconstruction>(`${at(id)}:cancel`),
  remove: async (id: string) => void (await call(at(id), { method: 'DELETE' })),
  log: async (id: string) => (await getJson<{ entries?: LogEntry[] }>(`${at(id)}/log`)).entries ?? [],
  files: async (id: string) => (await getJson<{ files?: SceneFile[] }>(`${at(id)}/files`)).files ?? [],
  workers: async () => (await getJson<{ workers?: Worker[] }>('workers')).workers ?? [],
  drain: async (worker: string) => void (await call(`workers/${encodeURIComponent(worker)}:drain`, { method: 'POST' })),
  formats: async () => (await getJson<{ formats?: Format[] }>('formats')).formats ?? [],
  options: () => getJson<{ options?: Option[]; presets?: Preset[] }>('options'),
};
