// SPDX-License-Identifier: Apache-2.0
// Thousands of cameras in columns: cheap to hand from one thread to another, and to go through at every event.
import { CAMERA_STATES, type Camera, type CameraState } from './types';

export interface CameraTable {
  count: number;
  names: string[];
  states: Uint8Array; // positions in CAMERA_STATES
  sequences: Int32Array; // 0: not chosen yet
  acceptedPatches: Float64Array;
  attempts: Uint16Array;
  workers: string[]; // who has it now, or had it last; '' when nobody had
  // coveredBefore, grown, filtered, accepted per camera, 0..1; NaN where there is none yet.
  shares: Float32Array;
  seconds: Float32Array; // of all stages; NaN where not processed
  // Row-wise world_from_cam rotation (9) and the camera's centre in the world (3), per camera.
  poses: Float32Array;
  // left, right, top, bottom of the image at depth 1 in the camera's frame, per camera.
  frusta: Float32Array;
}

export const SHARES = 4;
export const POSE = 12;
export const FRUSTUM = 4;

export function stateOfCamera(table: CameraTable, index: number): CameraState {
  return CAMERA_STATES[table.states[index]!]!;
}

// Cameras come by index, 0, 1, 2 ...
export function makeCameraTable(cameras: readonly Camera[]): CameraTable {
  const count = cameras.length;
  const table: CameraTable = {
    count,
    names: cameras.map((camera) => camera.name),
    states: new Uint8Array(count),
    sequences: new Int32Array(count),
    acceptedPatches: new Float64Array(count),
    attempts: new Uint16Array(count),
    workers: cameras.map((camera) => camera.worker ?? ''),
    shares: new Float32Array(SHARES * count).fill(NaN),
    seconds: new Float32Array(count).fill(NaN),
    poses: new Float32Array(POSE * count),
    frusta: new Float32Array(FRUSTUM * count),
  };
  cameras.forEach((camera, i) => {
    const state = CAMERA_STATES.indexOf(camera.state.replace('CAMERA_STATE_', '') as CameraState);
    table.states[i] = Math.max(state, 0);
    table.sequences[i] = camera.sequence;
    table.acceptedPatches[i] = Number(camera.acceptedPatches ?? 0);
    table.attempts[i] = camera.attempts ?? 0;
    const { shares, seconds } = camera;
    if (shares) {
      const { coveredBefore = NaN, grown = NaN, filtered = NaN, accepted = NaN } = shares;
      table.shares.set([coveredBefore, grown, filtered, accepted], SHARES * i);
    }
    const times = Object.values(seconds ?? {});
    if (times.length > 0) table.seconds[i] = times.reduce((sum, time) => sum + time, 0);

    const { width, height, fx, fy, cx, cy, rotation: r, translation: t } = camera.geometry;
    const pose = table.poses.subarray(POSE * i, POSE * (i + 1));
    for (let row = 0; row < 3; ++row) {
      for (let column = 0; column < 3; ++column) pose[3 * row + column] = r[3 * column + row]!;
      pose[9 + row] = -(r[row]! * t[0]! + r[3 + row]! * t[1]! + r[6 + row]! * t[2]!);
    }
    table.frusta.set([-cx / fx, (width - cx) / fx, -cy / fy, (height - cy) / fy], FRUSTUM * i);
  });
  return table;
}
