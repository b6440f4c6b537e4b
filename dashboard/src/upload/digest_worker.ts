// SPDX-License-Identifier: Apache-2.0
// SHA-256 of files, piece by piece, so that neither the page stops nor a file has to fit into memory.
import { sha256 } from '@noble/hashes/sha2';
import { bytesToHex } from '@noble/hashes/utils';

const PIECE_BYTES = 4 << 20;

self.onmessage = async ({ data }: MessageEvent<{ id: number; blob: Blob }>) => {
  try {
    self.postMessage({ id: data.id, digest: await digestOf(data.blob) });
  } catch (error) {
    self.postMessage({ id: data.id, error: (error as Error).message });
  }
};

async function digestOf(blob: Blob): Promise<string> {
  // WebCrypto is many times faster, but takes only whole messages and is there only on localhost and under https.
  if (blob.size <= 16 * PIECE_BYTES && self.crypto.subtle !== undefined) {
    return bytesToHex(new Uint8Array(await self.crypto.subtle.digest('SHA-256', await blob.arrayBuffer())));
  }
  const hash = sha256.create();
  for (let at = 0; at < blob.size; at += PIECE_BYTES) {
    hash.update(new Uint8Array(await blob.slice(at, at + PIECE_BYTES).arrayBuffer()));
  }
  return bytesToHex(hash.digest());
}
