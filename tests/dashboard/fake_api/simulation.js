// SPDX-License-Identifier: Apache-2.0
// A reconstruction that goes on by itself: cameras over a terrain are assigned to workers, fail now and then, and are
// committed in order.
import { createHash } from 'node:crypto';
import { makePreview } from './preview.js';

const CELL = 4; // world units between cameras
const ALTITUDE = 22;
const WINDOW = 24;

// Numbers in [0, 1) that depend on their arguments alone.
function draw(...keys) {
  return createHash('md5').update(keys.join('/')).digest().readUInt32LE(0) / 2 ** 32;
}

export class Simulation {
  // `commitsPerSecond` 0: nothing moves. `startCommitted`: so far before anybody looked.
  constructor({
    id,
    cameras,
    facesPerPart,
    workers,
    commitsPerSecond,
    startCommitted,
    state = 'RUNNING',
    failure = '',
  }) {
    Object.assign(this, { id, failure, state, commitsPerSecond });
    this.workers = workers;
    this.columns = Math.ceil(Math.sqrt(cameras * 1.6));
    this.rows = Math.round(Math.sqrt(facesPerPart / 2)) + 1;
    this.createTime = Date.now() - (startCommitted / Math.max(commitsPerSecond, 1)) * 1000 - 2000;
    this.finishTime = null;
    this.listeners = new Set();
    this.attempts = [];
    this.log = [];
    this.parts = [];
    this.cameras = Array.from({ length: cameras }, (_, index) => this.makeCamera(index));
    this.order = this.cameras.map((camera) => camera.index);
    this.say(this.createTime, 'info', `The scene has ${cameras} cameras`);
    this.chosen = 0;
    for (let i = 0; i < startCommitted; ++i) {
      this.now = this.createTime + 1000 + (i / Math.max(commitsPerSecond, 1)) * 1000;
      this.step();
    }
    if (state !== 'RUNNING') this.finish(state);
  }

  makeCamera(index) {
    const [column, row] = [index % this.columns, Math.floor(index / this.columns)];
    const [x, y] = [column * CELL, row * CELL];
    // Looks straight down, north up: X right, Y down in the photograph, Z towards the ground.
    const rotation = [1, 0, 0, 0, -1, 0, 0, 0, -1];
    const geometry = {
      width: 4000,
      height: 3000,
      fx: 3600,
      fy: 3600,
      cx: 2000,
      cy: 1500,
      rotation,
    };
    geometry.translation = [-x, y, ALTITUDE];
    const name = `DJI_${String(index).padStart(4, '0')}.JPG`;
    return {
      index,
      name,
      state: 'CAMERA_STATE_WAITING',
      sequence: 0,
      attempts: 0,
      worker: '',
      geometry,
    };
  }

  neighbours(index) {
    const [column, row] = [index % this.columns, Math.floor(index / this.columns)];
    const found = [];
    for (let j = row - 2; j <= row + 2; ++j) {
      for (let i = column - 2; i <= column + 2; ++i) {
        const other = j * this.columns + i;
        if (i >= 0 && i < this.columns && j >= 0 && other < this.cameras.length && other !== index) found.push(other);
      }
    }
    return found;
  }

  say(time, severity, message, more = {}) {
    this.log.push({
      time: new Date(time).toISOString(),
      severity,
      message,
      ...more,
    });
    if (this.log.length > 1000) this.log.shift();
  }

  // Fills the window, then ends and commits the first camera in flight.
  step() {
    while (this.chosen < this.order.length && this.chosen - this.parts.length - this.skipped() < WINDOW) {
      const camera = this.cameras[this.order[this.chosen]];
      camera.sequence = ++this.chosen;
      camera.state = 'CAMERA_STATE_ASSIGNED';
      this.begin(camera);
    }
    const next = this.parts.length + this.skipped();
    if (next >= this.order.length) return false;
    const camera = this.cameras[this.order[next]];
    this.end(camera);
    return true;
  }

  skipped() {
    return this.asideCount ?? 0;
  }

  begin(camera) {
    const worker = this.workers[camera.sequence % this.workers.length];
    camera.attempts += 1;
    camera.worker = worker;
    camera.attempt = {
      sequence: camera.sequence,
      camera: camera.index,
      epoch: String(camera.attempts),
      worker,
      reconstructionId: this.id,
      beginTime: new Date(this.now).toISOString(),
      ending: 'ATTEMPT_ENDING_UNSPECIFIED',
    };
    this.attempts.push(camera.attempt);
  }

  close(attempt, ending, reason) {
    Object.assign(attempt, {
      ending: `ATTEMPT_ENDING_${ending}`,
      endTime: new Date(this.now).toISOString(),
    });
    if (reason) attempt.reason = reason;
  }

  end(camera) {
    const luck = draw(this.id, camera.index);
    if (luck < 0.012) {
      const lost = luck < 0.006;
      const reason = lost ? 'the lease ran out' : 'out of memory: 5120 MiB wanted, 4096 MiB allowed';
      this.close(camera.attempt, lost ? 'LOST' : 'OUT_OF_MEMORY', reason);
      this.say(this.now, 'warning', `${lost ? 'Lease lost' : 'Failed'}: ${reason}; tried again`, {
        camera: camera.index,
        worker: camera.worker,
      });
      this.begin(camera);
    }
    this.close(camera.attempt, 'FINISHED');
    if (draw(this.id, camera.index, 'aside') < 0.001) {
      camera.state = 'CAMERA_STATE_SKIPPED';
      camera.skipReason = 'failed three times: the photograph cannot be decoded';
      this.asideCount = this.skipped() + 1;
      this.say(this.now, 'error', `Skipped: ${camera.skipReason}`, {
        camera: camera.index,
      });
      return;
    }
    const age = camera.sequence / this.order.length;
    const grown = Math.max(0.05, 0.9 - 0.7 * age + 0.12 * (draw(camera.index, 1) - 0.5));
    const faces = 2 * (this.rows - 1) ** 2;
    Object.assign(camera, {
      state: 'CAMERA_STATE_COMMITTED',
      filteredPatches: String(Math.round(faces * 0.62)),
      acceptedPatches: String(Math.round(faces / 1.9)),
      shares: {
        coveredBefore: Math.max(0, 1 - grown - 0.05),
        grown,
        filtered: grown * 0.93,
        accepted: grown * (0.72 + 0.15 * draw(camera.index, 2)),
      },
      seconds: {
        loading: 0.3,
        visibility: 0.2,
        seeding: 0.8,
        growing: 6 * grown,
        filtering: 3.1,
        refinement: 1.2,
      },
      reportJson: JSON.stringify({
        neighbours: 24,
        targets: this.neighbours(camera.index)
          .slice(0, 8)
          .map((other) => this.cameras[other].name),
        seeds: Math.round(9000 * grown),
        seeds_from_points: Math.round(2000 * grown),
        tentative_patches_scored: Math.round(4e6 * grown),
        patches_grown: Math.round(800_000 * grown),
        mrf_energy: 12345.6,
        mrf_lower_bound: 12300.1,
      }),
    });
    const part = {
      sequence: camera.sequence,
      camera: camera.index,
      sha256: createHash('sha256').update(`${this.id}/${camera.index}`).digest('hex'),
      patches: camera.acceptedPatches,
    };
    this.parts.push(part);
    this.emit('part', part);
  }

  finish(state) {
    this.state = state;
    this.finishTime = this.now ?? Date.now();
    this.say(this.finishTime, 'info', `The reconstruction is ${state.toLowerCase()}`);
    this.emit('reconstruction', this.reconstruction());
    this.emit('end', {});
  }

  // Commits what is due by the clock.
  tick(seconds) {
    if (this.state !== 'RUNNING') return;
    this.due = (this.due ?? 0) + this.commitsPerSecond * seconds;
    this.now = Date.now();
    let moved = false;
    for (; this.due >= 1; --this.due) {
      if (!this.step()) return this.finish('DONE');
      moved = true;
    }
    if (moved) this.emit('reconstruction', this.reconstruction());
  }

  emit(event, data) {
    for (const listener of this.listeners) listener(event, data);
  }

  reconstruction() {
    const patches = this.parts.reduce((sum, part) => sum + Number(part.patches), 0);
    const faces = this.parts.length * 2 * (this.rows - 1) ** 2;
    const done = this.state === 'DONE';
    return {
      id: this.id,
      state: `RECONSTRUCTION_STATE_${this.state}`,
      failure: this.failure,
      optionsJson: '{}',
      sceneReference: '',
      weight: 1,
      createTime: new Date(this.createTime).toISOString(),
      ...(this.finishTime ? { finishTime: new Date(this.finishTime).toISOString() } : {}),
      progress: {
        camerasTotal: this.order.length,
        camerasCommitted: this.parts.length + this.skipped(),
        camerasSkipped: this.skipped(),
        camerasInFlight: this.state === 'RUNNING' ? this.chosen - this.parts.length - this.skipped() : 0,
        jobsLeased: this.state === 'RUNNING' ? this.workers.length : 0,
        patchesFiltered: String(Math.round(patches * 1.18)),
        patchesAccepted: String(patches),
        vertices: done ? String(Math.round(faces / 2)) : '0',
        faces: done ? String(faces) : '0',
      },
      meshBytes: done ? String(faces * 30) : '0',
      meshSha256: '',
    };
  }

  camerasJson() {
    return { cameras: this.cameras.map(({ attempt: _, ...camera }) => camera) };
  }

  incidenceJson() {
    const pairs = [];
    for (const { index, sequence } of this.cameras) {
      if (sequence > 0) for (const target of this.neighbours(index)) pairs.push({ reference: index, target });
    }
    return { pairs };
  }

  preview(sequence, maxFaces) {
    const part = this.parts.find((candidate) => candidate.sequence === sequence);
    if (part === undefined) return null;
    const [column, row] = [part.camera % this.columns, Math.floor(part.camera / this.columns)];
    const [x0, y0] = [(column - 0.5) * CELL, (row - 0.5) * CELL];
    return makePreview({
      sequence,
      camera: part.camera,
      x0,
      y0,
      size: CELL,
      rows: this.rows,
      maxFaces,
    });
  }
}
