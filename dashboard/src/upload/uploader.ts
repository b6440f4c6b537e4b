// SPDX-License-Identifier: Apache-2.0
// Brings the files of a scene to the coordinator, in parts. Whatever breaks (the network, the coordinator, the page
// itself), beginning again goes on where the coordinator says it is.
import { ApiError } from '../api/client';
import type { SceneFile } from '../api/types';

export interface FileToSend {
  path: string; // relative to the scene's folder, with "/"
  blob: Blob;
}

export interface UploadProgress {
  files: number;
  filesDone: number;
  bytes: number;
  bytesDone: number; // that the coordinator has
  bytesSkipped: number; // of these, that were there before
  current: string; // path of a file under way
  retryInMs: number; // > 0 while waiting after an error
  error: string;
}

// Answers with the offset that the coordinator has now; throws ApiError. Status 0: nobody answered.
export type SendPart = (part: {
  path: string;
  size: number;
  sha256: string;
  offset: number;
  partSha256: string;
  body: Blob;
}) => Promise<number>;

export interface UploaderOptions {
  files: readonly FileToSend[];
  // What the coordinator has already; asked at the beginning and after each interruption.
  listFiles: () => Promise<readonly SceneFile[]>;
  sendPart: SendPart;
  digest: (blob: Blob) => Promise<string>;
  onProgress: (progress: UploadProgress) => void;
  wait?: (ms: number) => Promise<void>;
  partBytes?: number;
}

const PART_BYTES = 8 << 20;
const LONGEST_WAIT_MS = 20_000;

// Worth trying again: nobody answered, or somebody who could not at that moment.
export function isPassing(error: unknown): boolean {
  return error instanceof ApiError && (error.status === 0 || error.status === 429 || error.status >= 500);
}

export class Uploader {
  private readonly wait: (ms: number) => Promise<void>;
  private readonly partBytes: number;
  private readonly progress: UploadProgress;
  private readonly done = new Map<string, number>(); // bytes at the coordinator, per path
  private stopped = false;

  constructor(private readonly options: UploaderOptions) {
    this.wait = options.wait ?? ((ms) => new Promise((resolve) => setTimeout(resolve, ms)));
    this.partBytes = options.partBytes ?? PART_BYTES;
    this.progress = {
      files: options.files.length,
      filesDone: 0,
      bytes: options.files.reduce((sum, file) => sum + file.blob.size, 0),
      bytesDone: 0,
      bytesSkipped: 0,
      current: '',
      retryInMs: 0,
      error: '',
    };
  }

  stop() {
    this.stopped = true;
  }

  // Returns when all files are there; throws what cannot be mended by trying again, and Error('stopped') after stop().
  async run() {
    let known = await this.patiently(() => this.options.listFiles());
    for (const file of this.options.files) {
      this.report({ current: file.path });
      const sha256 = await this.options.digest(file.blob);
      const there = known.find((other) => other.path === file.path && other.sha256 === sha256);
      let offset = there === undefined ? 0 : there.complete ? file.blob.size : Number(there.offsetBytes);
      this.progress.bytesSkipped += offset;
      this.took(file.path, offset);
      // An empty file is one empty part.
      let complete = there?.complete ?? false;
      while (!complete) {
        offset = await this.patiently(() => this.sendNext(file, sha256, offset));
        complete = offset >= file.blob.size;
        this.took(file.path, offset);
      }
      this.report({ filesDone: this.progress.filesDone + 1 });
    }
    this.report({ current: '' });
  }

  private async sendNext(file: FileToSend, sha256: string, offset: number): Promise<number> {
    const body = file.blob.slice(offset, offset + this.partBytes);
    const whole = body.size === file.blob.size;
    const partSha256 = whole ? sha256 : await this.options.digest(body);
    try {
      return await this.options.sendPart({ path: file.path, size: file.blob.size, sha256, offset, partSha256, body });
    } catch (error) {
      // It is elsewhere than we thought, as when an answer was lost: ask, and go on from there.
      if (!(error instanceof ApiError) || error.status !== 409) throw error;
      const there = (await this.options.listFiles()).find((other) => other.path === file.path);
      const now = there?.sha256 === sha256 ? Number(there.offsetBytes) : 0;
      if (now === offset) throw error;
      return now;
    }
  }

  private async patiently<T>(action: () => Promise<T>): Promise<T> {
    for (let attempt = 0; ; ++attempt) {
      if (this.stopped) throw new Error('stopped');
      try {
        const answer = await action();
        this.report({ retryInMs: 0, error: '' });
        return answer;
      } catch (error) {
        if (!isPassing(error)) throw error;
        const retryInMs = Math.min(LONGEST_WAIT_MS, 500 * 2 ** attempt);
        this.report({ retryInMs, error: (error as Error).message });
        await this.wait(retryInMs);
      }
    }
  }

  private took(path: string, offset: number) {
    this.progress.bytesDone += offset - (this.done.get(path) ?? 0);
    this.done.set(path, offset);
    this.report({});
  }

  private report(change: Partial<UploadProgress>) {
    Object.assign(this.progress, change);
    this.options.onProgress({ ...this.progress });
  }
}
