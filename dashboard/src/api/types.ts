// SPDX-License-Identifier: Apache-2.0
// What the coordinator's REST API says (coordinator/rest/openapi.yaml), as far as the page reads it. 64-bit integers
// are strings there.

export type ReconstructionState = 'CREATED' | 'PREPARING' | 'RUNNING' | 'JOINING' | 'DONE' | 'FAILED' | 'CANCELLED';

export interface Progress {
  camerasTotal?: number;
  camerasCommitted?: number;
  camerasSkipped?: number;
  camerasInFlight?: number;
  jobsLeased?: number;
  patchesFiltered?: string;
  patchesAccepted?: string;
  vertices?: string;
  faces?: string;
  joinedShare?: number; // 0 to 1, while JOINING
}

// Shares of the rays of all processed cameras.
export interface Verdict {
  summary?: string;
  warning?: string;
  coverage?: number;
  inferred?: number; // of what is covered
  blind?: number;
  inconsistent?: number;
  unsupported?: number;
  contradicted?: number;
}

export interface Reconstruction {
  id: string;
  state: `RECONSTRUCTION_STATE_${ReconstructionState}`;
  failure?: string;
  optionsJson?: string;
  sceneReference?: string;
  weight?: number;
  createTime?: string;
  finishTime?: string;
  progress?: Progress;
  meshBytes?: string;
  meshSha256?: string;
  stage?: string; // what is being done while PREPARING or JOINING, in words
  expectedFinishTime?: string; // while RUNNING or JOINING, as soon as something can be said
  warnings?: string[];
  verdict?: Verdict; // when DONE
}

// Positions are the numbers in CameraTable.states.
export const CAMERA_STATES = ['WAITING', 'ASSIGNED', 'DONE', 'COMMITTED', 'SKIPPED'] as const;
export type CameraState = (typeof CAMERA_STATES)[number];

export interface Camera {
  index: number;
  name: string;
  state: `CAMERA_STATE_${CameraState}`;
  sequence: number;
  filteredPatches?: string;
  acceptedPatches?: string;
  skipReason?: string;
  reportJson?: string;
  geometry: {
    width: number;
    height: number;
    fx: number;
    fy: number;
    cx: number;
    cy: number;
    rotation: number[]; // cam_from_world, by rows
    translation: number[];
  };
  shares?: { coveredBefore?: number; grown?: number; filtered?: number; accepted?: number };
  seconds?: Record<string, number>;
  attempts?: number;
  worker?: string;
}

export interface Part {
  sequence: number;
  camera: number;
  sha256: string;
  patches: string;
}

// UNSPECIFIED: it runs.
export const ATTEMPT_ENDINGS = ['UNSPECIFIED', 'FINISHED', 'FAILED', 'OUT_OF_MEMORY', 'LOST', 'RELEASED'] as const;
export type AttemptEnding = (typeof ATTEMPT_ENDINGS)[number];

export interface Attempt {
  reconstructionId: string;
  sequence: number;
  camera: number;
  worker: string;
  beginTime: string;
  endTime?: string;
  ending: `ATTEMPT_ENDING_${AttemptEnding}`;
  reason?: string;
}

export function runs(attempt: Attempt): boolean {
  return attempt.ending === 'ATTEMPT_ENDING_UNSPECIFIED';
}

export interface LogEntry {
  time: string;
  severity: 'info' | 'warning' | 'error';
  message: string;
  camera?: number;
  worker?: string;
}

export interface Worker {
  id: string;
  cores?: number;
  memoryBytes?: string;
  draining?: boolean;
  jobs?: number;
  lastSeen?: string;
  version?: string;
  running?: Attempt[];
}

export interface Option {
  name: string;
  group: string;
  type: 'integer' | 'number';
  unit: string;
  default: number;
  minimum: number;
  maximum: number;
  documentation: string;
  tradeOff: string;
}

export interface Preset {
  name: string;
  documentation: string;
  values: Record<string, number>;
}

export interface Format {
  name: string;
  ending: string;
  title: string;
  note: string;
}

export interface SceneFile {
  path: string;
  sizeBytes: string;
  sha256: string;
  offsetBytes: string;
  complete: boolean;
}

export interface Problem {
  title: string;
  status: number;
  detail: string;
  code?: string;
  field?: string;
}

export function stateOf(reconstruction: Reconstruction): ReconstructionState {
  return reconstruction.state.replace('RECONSTRUCTION_STATE_', '') as ReconstructionState;
}

export function isOver(state: ReconstructionState): boolean {
  return state === 'DONE' || state === 'FAILED' || state === 'CANCELLED';
}
