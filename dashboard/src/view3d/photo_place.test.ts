// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';
import { placePhoto } from './photo_place';

// Of photographs of 4:3 and 3:4, and of one whose axis is not in its middle.
const FRUSTA = [
  [-0.6, 0.6, -0.45, 0.45],
  [-0.45, 0.45, -0.6, 0.6],
  [-0.5, 0.7, -0.5, 0.4],
];
const CANVASES = [
  [1200, 600],
  [400, 700],
] as const;

describe('a photograph over the view', () => {
  for (const frustum of FRUSTA) {
    for (const [width, height] of CANVASES) {
      const place = placePhoto(frustum, width, height);
      const pxPerUnit = height / 2 / Math.tan((place.fieldOfView * Math.PI) / 360);

      it(`${frustum} lies on ${width} x ${height} where the view draws its corners`, () => {
        expect(place.left).toBeCloseTo(width / 2 + frustum[0]! * pxPerUnit);
        expect(place.left + place.width).toBeCloseTo(width / 2 + frustum[1]! * pxPerUnit);
        expect(place.top).toBeCloseTo(height / 2 + frustum[2]! * pxPerUnit);
        expect(place.top + place.height).toBeCloseTo(height / 2 + frustum[3]! * pxPerUnit);
      });

      it(`${frustum} is whole on ${width} x ${height} and touches an edge`, () => {
        const gaps = [place.left, width - place.left - place.width, place.top, height - place.top - place.height];
        expect(Math.min(...gaps)).toBeCloseTo(0);
      });
    }
  }
});
