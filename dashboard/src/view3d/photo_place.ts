// SPDX-License-Identifier: Apache-2.0
// Where a camera's photograph lies on the canvas when the view stands where the camera stood and looks where it looked.

export interface PhotoPlace {
  fieldOfView: number; // of the whole canvas, top to bottom, degrees
  left: number; // px of the canvas, as are the following
  top: number;
  width: number;
  height: number;
}

// As large as fits with the camera's axis in the middle of the canvas of `width` x `height` px. `frustum`: left, right,
// top, bottom of the photograph at depth 1.
export function placePhoto(frustum: ArrayLike<number>, width: number, height: number): PhotoPlace {
  const [left, right, top, bottom] = [frustum[0]!, frustum[1]!, frustum[2]!, frustum[3]!];
  const pxPerUnit = Math.min(width / 2 / Math.max(-left, right), height / 2 / Math.max(-top, bottom));
  return {
    fieldOfView: (2 * Math.atan(height / 2 / pxPerUnit) * 180) / Math.PI,
    left: width / 2 + left * pxPerUnit,
    top: height / 2 + top * pxPerUnit,
    width: (right - left) * pxPerUnit,
    height: (bottom - top) * pxPerUnit,
  };
}
