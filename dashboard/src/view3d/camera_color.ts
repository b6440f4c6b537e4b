// SPDX-License-Identifier: Apache-2.0
// Neighbouring cameras have neighbouring numbers: the golden angle gives them colours far apart.
export function cameraHue(camera: number): number {
  return (camera * 137.50776405 + 20) % 360;
}

export function cameraColorCss(camera: number): string {
  return `hsl(${cameraHue(camera).toFixed(0)} 62% 52%)`;
}
