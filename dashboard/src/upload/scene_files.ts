// SPDX-License-Identifier: Apache-2.0
// What was dropped or chosen, as the files of a scene.
import type { FileToSend } from './uploader';

interface Picked {
  path: string;
  file: File;
}

const IGNORED = /(^|\/)(\.[^/]*|Thumbs\.db|desktop\.ini|__MACOSX)(\/|$)/;
const PHOTOGRAPH = /\.(jpe?g|png|pgm|ppm)$/i;

async function filesIn(entry: FileSystemEntry, folder: string): Promise<Picked[]> {
  const path = folder + entry.name;
  if (entry.isFile) {
    const file = await new Promise<File>((resolve, reject) => (entry as FileSystemFileEntry).file(resolve, reject));
    return [{ path, file }];
  }
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  const found: Picked[] = [];
  for (;;) {
    // At most 100 entries at a time, until none is left.
    const some = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
    if (some.length === 0) return found;
    for (const child of some) found.push(...(await filesIn(child, `${path}/`)));
  }
}

// Must be called within the drop's own event: what is dropped is gone afterwards.
export function readDropped(items: DataTransferItemList): Promise<FileToSend[]> {
  const entries = [...items].map((item) => item.webkitGetAsEntry()).filter((entry) => entry !== null);
  return Promise.all(entries.map((entry) => filesIn(entry, ''))).then((found) => toScene(found.flat()));
}

export function readChosen(files: FileList): FileToSend[] {
  return toScene([...files].map((file) => ({ path: file.webkitRelativePath || file.name, file })));
}

// Paths relative to the one folder that everything lies in, without what systems leave lying about; by path.
export function toScene(picked: readonly Picked[]): FileToSend[] {
  const kept = picked.filter(({ path }) => !IGNORED.test(path));
  const top = kept[0]?.path.split('/')[0];
  const nested = kept.length > 0 && kept.every(({ path }) => path.startsWith(`${top}/`));
  return kept
    .map(({ path, file }) => ({ path: nested ? path.slice(top!.length + 1) : path, blob: file }))
    .sort((a, b) => (a.path < b.path ? -1 : 1));
}

export interface SceneSummary {
  format: 'COLMAP' | 'Middlebury' | 'Strecha' | null; // null: no cameras were found
  photographs: number;
  bytes: number;
}

// By the names of files; the coordinator looks at what is in them.
export function describeScene(files: readonly { path: string; blob: { size: number } }[]): SceneSummary {
  const has = (pattern: RegExp) => files.some(({ path }) => pattern.test(path));
  const colmap = /^(model\/|sparse\/|sparse\/0\/)?(cameras|images|points3D)\.(txt|bin)$/;
  const format = has(colmap) ? 'COLMAP' : has(/_par\.txt$/) ? 'Middlebury' : has(/\.camera$/) ? 'Strecha' : null;
  return {
    format,
    photographs: files.filter(({ path }) => PHOTOGRAPH.test(path)).length,
    bytes: files.reduce((sum, { blob }) => sum + blob.size, 0),
  };
}

// A name that the coordinator takes: 1 to 64 of a-z, 0-9 and "-", a letter or digit first.
export function idFrom(name: string): string {
  return name
    .toLowerCase()
    .replace(/[^a-z0-9]+/g, '-')
    .replace(/^-+|-+$/g, '')
    .slice(0, 64);
}

export const VALID_ID = /^[a-z0-9][a-z0-9-]{0,63}$/;
