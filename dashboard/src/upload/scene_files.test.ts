// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';
import { describeScene, idFrom, toScene, VALID_ID } from './scene_files';

const picked = (...paths: string[]) => paths.map((path) => ({ path, file: new File(['x'], path.split('/').at(-1)!) }));
const paths = (...from: string[]) => toScene(picked(...from)).map((file) => file.path);

describe('toScene', () => {
  it('takes away the folder that everything lies in, and only that', () => {
    expect(paths('castle/images/b.jpg', 'castle/images/a.jpg', 'castle/cameras.txt')).toEqual([
      'cameras.txt',
      'images/a.jpg',
      'images/b.jpg',
    ]);
    expect(paths('images/a.jpg', 'cameras.txt')).toEqual(['cameras.txt', 'images/a.jpg']);
    expect(paths('a/x.jpg', 'ab/y.jpg')).toEqual(['a/x.jpg', 'ab/y.jpg']);
    expect(paths()).toEqual([]);
  });
  it('leaves out what systems leave lying about', () => {
    expect(paths('s/.DS_Store', 's/Thumbs.db', 's/.git/config', 's/__MACOSX/a.jpg', 's/a.jpg')).toEqual(['a.jpg']);
  });
});

describe('describeScene', () => {
  it.each([
    ['COLMAP', ['images/a.jpg', 'sparse/0/cameras.bin']],
    ['COLMAP', ['a.png', 'cameras.txt']],
    ['Middlebury', ['templeR_par.txt', 'templeR0001.png']],
    ['Strecha', ['0000.jpg', '0000.jpg.camera']],
    [null, ['a.jpg', 'notes.txt']],
  ])('sees %s', (format, files) => {
    expect(describeScene(toScene(picked(...files)))).toMatchObject({ format, photographs: 1 });
  });
});

describe('idFrom', () => {
  it.each(['Fountain P11', 'tüür', '--x--', 'a'.repeat(100), 'A_b.c'])('makes %s valid', (name) => {
    expect(idFrom(name)).toMatch(VALID_ID);
  });
});
