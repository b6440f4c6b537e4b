// SPDX-License-Identifier: Apache-2.0
// The surface that the simulated cameras see: hills with a town on them, as a height over (x, y).

function hash(x, y) {
  const bits = Math.imul(x, 374761393) ^ Math.imul(y, 668265263);
  const mixed = Math.imul(bits ^ (bits >>> 13), 1274126177);
  return ((mixed ^ (mixed >>> 16)) >>> 0) / 2 ** 32;
}

function noise(x, y) {
  const [i, j] = [Math.floor(x), Math.floor(y)];
  const smooth = (t) => t * t * (3 - 2 * t);
  const [u, v] = [smooth(x - i), smooth(y - j)];
  const top = hash(i, j) * (1 - u) + hash(i + 1, j) * u;
  const bottom = hash(i, j + 1) * (1 - u) + hash(i + 1, j + 1) * u;
  return top * (1 - v) + bottom * v;
}

function houseAt(x, y) {
  const [i, j] = [Math.floor(x / 3), Math.floor(y / 3)];
  const [u, v] = [x / 3 - i, y / 3 - j];
  const built = hash(i + 7, j - 3) < 0.55 && u > 0.2 && u < 0.8 && v > 0.2 && v < 0.8;
  if (!built) return null;
  const ridge = 1 - Math.abs(v - 0.5) / 0.3;
  return {
    height: 0.7 + hash(i, j + 9) * 0.9 + 0.45 * ridge,
    tone: hash(i - 5, j),
  };
}

export function height(x, y) {
  const ground = 9 * noise(x / 37, y / 37) + 2.5 * noise(x / 11, y / 11);
  return ground + (houseAt(x, y)?.height ?? 0.12 * noise(x * 2, y * 2));
}

export function color(x, y) {
  const house = houseAt(x, y);
  const grain = 0.86 + 0.28 * hash(Math.floor(x * 9), Math.floor(y * 9));
  const base = house
    ? house.tone < 0.5
      ? [176, 92, 66]
      : [148, 140, 132]
    : noise(x / 5, y / 5) > 0.5
      ? [104, 132, 72]
      : [150, 146, 104];
  return base.map((value) => Math.min(255, Math.round(value * grain)));
}
