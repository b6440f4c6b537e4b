// SPDX-License-Identifier: Apache-2.0
import type { PartGeometry } from '../view3d/preview_decoder';
import type { CameraTable } from './camera_table';
import { ApiError } from './client';
import type { Attempt, Camera } from './types';

interface Answers {
  cameras: CameraTable;
  camera: Camera | null;
  incidence: Int32Array; // reference, target, reference, target ...
  attempts: Attempt[];
  held: Attempt[]; // those that run
  preview: PartGeometry;
}

type Question =
  | { kind: 'cameras'; url: string }
  | { kind: 'camera'; index: number } // of the cameras that were asked for last
  | { kind: 'incidence'; url: string }
  // These two: the address of the reconstruction.
  | { kind: 'attempts'; url: string }
  | { kind: 'held'; url: string }
  | { kind: 'preview'; url: string };

export type DataRequest = { id: number } & Question;
export type DataResponse = { id: number; value: unknown } | { id: number; error: string; status: number };

// The page's side of data_worker.ts; one for each page that needs it.
export class DataService {
  private readonly worker = new Worker(new URL('./data_worker.ts', import.meta.url), { type: 'module' });
  private readonly waiting = new Map<number, { resolve: (value: never) => void; reject: (error: Error) => void }>();
  private lastId = 0;

  constructor() {
    this.worker.onmessage = ({ data }: MessageEvent<DataResponse>) => {
      const waiter = this.waiting.get(data.id);
      this.waiting.delete(data.id);
      if ('error' in data) waiter?.reject(new ApiError(data.status, data.error));
      else waiter?.resolve(data.value as never);
    };
  }

  ask<Kind extends Question['kind']>(
    question: Extract<Question, { kind: Kind }>,
    signal?: AbortSignal,
  ): Promise<Answers[Kind]> {
    const id = ++this.lastId;
    signal?.addEventListener('abort', () => this.worker.postMessage({ cancel: id }), { once: true });
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      this.worker.postMessage({ id, ...question });
    });
  }

  close() {
    this.worker.terminate();
    for (const { reject } of this.waiting.values()) reject(new ApiError(0, 'closed'));
    this.waiting.clear();
  }
}
