// SPDX-License-Identifier: Apache-2.0
type Waiter = { resolve: (digest: string) => void; reject: (error: Error) => void };

// SHA-256 as 64 hexadecimal digits, computed beside the page's own thread.
export class Digester {
  private readonly worker = new Worker(new URL('./digest_worker.ts', import.meta.url), { type: 'module' });
  private readonly waiting = new Map<number, Waiter>();
  private lastId = 0;

  constructor() {
    this.worker.onmessage = ({ data }: MessageEvent<{ id: number; digest?: string; error?: string }>) => {
      const waiter = this.waiting.get(data.id);
      this.waiting.delete(data.id);
      if (data.digest !== undefined) waiter?.resolve(data.digest);
      else waiter?.reject(new Error(`the file cannot be read: ${data.error}`));
    };
  }

  readonly digest = (blob: Blob): Promise<string> => {
    const id = ++this.lastId;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      this.worker.postMessage({ id, blob });
    });
  };

  close() {
    this.worker.terminate();
  }
}
