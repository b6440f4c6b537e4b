// SPDX-License-Identifier: Apache-2.0
import { createHash } from 'node:crypto';
import { describe, expect, it } from 'vitest';
import { ApiError } from '../api/client';
import type { SceneFile } from '../api/types';
import { Uploader, type FileToSend, type SendPart, type UploadProgress } from './uploader';

const hash = (bytes: Uint8Array) => createHash('sha256').update(bytes).digest('hex');
const digest = async (blob: Blob) => hash(new Uint8Array(await blob.arrayBuffer()));

// A coordinator as openapi.yaml describes it, that can lose requests and answers.
class FakeCoordinator {
  files = new Map<string, { size: number; sha256: string; bytes: Uint8Array }>();
  partsTaken = 0;
  bytesTaken = 0;
  requests = 0;
  beforePart: () => void = () => {};
  afterPart: () => void = () => {};

  listFiles = async (): Promise<SceneFile[]> =>
    [...this.files].map(([path, { size, sha256, bytes }]) => ({
      path,
      sizeBytes: String(size),
      sha256,
      offsetBytes: String(bytes.length),
      complete: bytes.length === size,
    }));

  sendPart: SendPart = async ({ path, size, sha256, offset, partSha256, body }) => {
    ++this.requests;
    this.beforePart();
    const part = new Uint8Array(await body.arrayBuffer());
    if (hash(part) !== partSha256) throw new ApiError(422, 'partSha256');
    let file = this.files.get(path);
    if (file?.sha256 !== sha256) file = { size, sha256, bytes: new Uint8Array(0) };
    if (offset > file.bytes.length) throw new ApiError(409, 'offset');
    if (offset + part.length > file.bytes.length) {
      file.bytes = new Uint8Array([...file.bytes.subarray(0, offset), ...part]);
      this.bytesTaken += part.length;
    }
    this.files.set(path, file);
    ++this.partsTaken;
    this.afterPart();
    return file.bytes.length;
  };
}

const scene = (): FileToSend[] =>
  [0, 1, 10, 64, 257].map((size, i) => ({
    path: `images/${i}.jpg`,
    blob: new Blob([new Uint8Array(size).map((_, k) => (k * 7 + i) & 255)]),
  }));
const TOTAL = 0 + 1 + 10 + 64 + 257;

async function expectAllThere(server: FakeCoordinator, files: FileToSend[]) {
  for (const { path, blob } of files) expect(hash(server.files.get(path)!.bytes)).toBe(await digest(blob));
}

function makeUploader(server: FakeCoordinator, files = scene(), seen: UploadProgress[] = []) {
  return new Uploader({
    files,
    listFiles: server.listFiles,
    sendPart: server.sendPart,
    digest,
    partBytes: 50,
    wait: async () => {},
    onProgress: (progress) => seen.push(progress),
  });
}

describe('Uploader', () => {
  it('brings every byte, in parts, and says so', async () => {
    const server = new FakeCoordinator();
    const seen: UploadProgress[] = [];
    await makeUploader(server, scene(), seen).run();
    await expectAllThere(server, scene());
    expect(server.partsTaken).toBe(1 + 1 + 1 + 2 + 6);
    expect(seen.at(-1)).toMatchObject({ bytesDone: TOTAL, bytes: TOTAL, filesDone: 5, bytesSkipped: 0, error: '' });
    for (let i = 1; i < seen.length; ++i) expect(seen[i]!.bytesDone).toBeGreaterThanOrEqual(seen[i - 1]!.bytesDone);
  });

  it('sends each byte once, wherever the network breaks', async () => {
    for (let broken = 1; broken <= 11; ++broken) {
      for (const hook of ['beforePart', 'afterPart'] as const) {
        const server = new FakeCoordinator();
        server[hook] = () => {
          if (server.requests === broken) {
            ++server.requests;
            throw new ApiError(0, 'nobody answers');
          }
        };
        await makeUploader(server).run();
        await expectAllThere(server, scene());
        expect(server.bytesTaken).toBe(TOTAL);
      }
    }
  });

  it('goes on in another page where the first was closed', async () => {
    const server = new FakeCoordinator();
    const first = makeUploader(server);
    server.afterPart = () => server.partsTaken === 7 && first.stop();
    await expect(first.run()).rejects.toThrow('stopped');
    const before = server.bytesTaken;
    expect(before).toBeLessThan(TOTAL);
    const seen: UploadProgress[] = [];
    await makeUploader(server, scene(), seen).run();
    await expectAllThere(server, scene());
    expect(server.bytesTaken).toBe(TOTAL);
    expect(seen.at(-1)!.bytesSkipped).toBe(before);
  });

  it('sends a file again when it is another one than before', async () => {
    const server = new FakeCoordinator();
    await makeUploader(server).run();
    const files = scene();
    files[3]!.blob = new Blob([new Uint8Array(64)]);
    await makeUploader(server, files).run();
    await expectAllThere(server, files);
    expect(server.bytesTaken).toBe(TOTAL + 64);
  });

  it('asks where to go on when the coordinator lost what it had', async () => {
    const server = new FakeCoordinator();
    server.afterPart = () => {
      if (server.partsTaken === 8) server.files.get('images/4.jpg')!.bytes = new Uint8Array(0);
    };
    await makeUploader(server).run();
    await expectAllThere(server, scene());
  });

  it('gives up on what trying again does not mend', async () => {
    const server = new FakeCoordinator();
    server.beforePart = () => {
      throw new ApiError(400, 'path: "..": expected a relative path');
    };
    await expect(makeUploader(server).run()).rejects.toThrow('expected a relative path');
    expect(server.requests).toBe(1);
  });
});
