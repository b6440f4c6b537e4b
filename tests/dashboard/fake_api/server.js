// SPDX-License-Identifier: Apache-2.0
// The coordinator's REST API (coordinator/rest/openapi.yaml) over simulated reconstructions, and the page beside it.
//   node server.js [--port 7421] [--cameras 5000] [--faces 4000] [--committed 3000] [--rate 20] [--page DIST]
import { createHash } from 'node:crypto';
import { createReadStream, existsSync, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { Simulation } from './simulation.js';

const TYPES = {
  '.html': 'text/html',
  '.js': 'text/javascript',
  '.css': 'text/css',
  '.svg': 'image/svg+xml',
};
const OPTIONS = [
  ['Reconstruction', 'max-image-size', 'integer', 'px', 0, [0, 100000], 'longest side of the images used; 0: as they are'],
  ['Reconstruction', 'lattice-step', 'integer', 'px', 2, [1, 16], "gamma: spacing of the reference camera's rays"],
  ['Reconstruction', 'window', 'integer', '', 4, [1, 100000], 'W: cameras chosen and not yet committed at the same time'],
  ['Seeds (3.5)', 'min-seed-quality', 'number', '', 0.6, [-1, 1], 'photo-consistency that a seed must reach'],
];

export class FakeApi {
  constructor({ page, cameras = 5000, faces = 4000, committed = 3000, rate = 20 }) {
    this.page = page;
    this.workers = Array.from({ length: 8 }, (_, i) => ({
      id: `worker-${i + 1}`,
      cores: 4,
      memoryBytes: String(16 * 2 ** 30),
      draining: false,
      jobs: i < 7 ? 3 : 0,
      version: '0.2.0',
    }));
    this.simulations = new Map();
    this.facesPerPart = faces;
    this.add({ id: 'campaign', cameras, startCommitted: committed, commitsPerSecond: rate });
    this.add({ id: 'second-flight', cameras: 240, startCommitted: 60, commitsPerSecond: rate / 10 });
    this.add({ id: 'done', cameras: 60, startCommitted: 60, state: 'DONE' });
    this.add({
      id: 'broken',
      cameras: 12,
      startCommitted: 2,
      state: 'FAILED',
      failure: 'images/DJI_0007.JPG: 4000 x 2250 px, but its camera has 4000 x 3000',
    });
    this.uploads = new Map(); // id -> path -> {size, sha256, bytes}
    this.created = new Map();
    this.startedWith = new Map(); // id -> path -> file
    this.optionsOf = new Map(); // id -> what it was created with
    this.requests = 0;
    this.failNext = 0; // so many of the next parts of files are refused
    this.streams = new Set();
  }

  // One more reconstruction: what Simulation takes, `id` and `cameras` at least.
  add(more) {
    const workers = this.workers.slice(0, 7).map((worker) => worker.id);
    const standing = { facesPerPart: this.facesPerPart, workers, commitsPerSecond: 0, startCommitted: 0 };
    this.simulations.set(more.id, new Simulation({ ...standing, ...more }));
  }

  async listen(port = 0) {
    this.server = createServer((request, response) => {
      this.requests += 1;
      this.handle(request, response).catch((error) => {
        if (!response.headersSent) problem(response, 500, String(error.stack));
        else response.destroy();
      });
    });
    await new Promise((resolve) => this.server.listen(port, '127.0.0.1', resolve));
    this.timer = setInterval(() => this.simulations.forEach((simulation) => simulation.tick(0.25)), 250);
    return this.server.address().port;
  }

  close() {
    clearInterval(this.timer);
    this.server.close();
    this.server.closeAllConnections();
  }

  // As when the coordinator restarts.
  breakStreams() {
    for (const response of this.streams) response.destroy();
  }

  async handle(request, response) {
    const url = new URL(request.url, 'http://localhost');
    const path = url.pathname;
    if (!path.startsWith('/v1/')) return this.file(path, response);
    const route = path.slice(4).split('/').map(decodeURIComponent);
    if (path === '/v1/options') return json(response, { options: OPTIONS.map(toOption) });
    if (path === '/v1/formats') {
      const format = (name, title) => ({ name, ending: `.${name}`, title, note: '' });
      return json(response, { formats: [format('ply', 'PLY'), format('glb', 'GLB')] });
    }
    if (path === '/v1/workers') {
      const lastSeen = new Date(Date.now() - 1200).toISOString();
      return json(response, {
        workers: this.workers.map((worker) => ({ ...worker, lastSeen, running: this.runningAt(worker.id) })),
      });
    }
    if (route[0] === 'workers' && route[1].endsWith(':drain')) {
      const worker = this.workers.find(({ id }) => `${id}:drain` === route[1]);
      if (worker === undefined) return problem(response, 404, 'worker: no such worker');
      worker.draining = true;
      return response.writeHead(204).end();
    }
    if (path === '/v1/reconstructions') return this.all(request, response);
    const [id, action] = route[1].split(':');
    if (action === 'again') return this.all(request, response);
    if (this.created.has(id)) return this.beingMade(request, response, url, id, action ?? '', route.slice(2));
    const simulation = this.simulations.get(id);
    if (simulation === undefined) return problem(response, 404, `id: "${id}": no such reconstruction`);
    return this.one(response, request, url, simulation, action ?? '', route.slice(2));
  }

  runningAt(worker) {
    return [...this.simulations.values()].flatMap(({ attempts }) =>
      attempts.filter((attempt) => attempt.worker === worker && attempt.ending === 'ATTEMPT_ENDING_UNSPECIFIED'),
    );
  }

  async all(request, response) {
    if (request.method === 'GET') {
      const made = [...this.created.values()];
      const reconstructions = [...this.simulations.values()].map((simulation) => simulation.reconstruction());
      return json(response, {
        reconstructions: [...reconstructions, ...made],
        nextPageToken: '',
      });
    }
    const body = JSON.parse(String(await bodyOf(request)));
    if (!/^[a-z0-9][a-z0-9-]{0,63}$/.test(body.id)) return problem(response, 400, `id: "${body.id}"`, 'id');
    const made = {
      ...body,
      state: 'RECONSTRUCTION_STATE_CREATED',
      createTime: new Date().toISOString(),
    };
    if (!this.created.has(body.id)) this.created.set(body.id, made);
    this.optionsOf.set(body.id, JSON.parse(body.optionsJson));
    return json(response, this.created.get(body.id));
  }

  async beingMade(request, response, url, id, action, rest) {
    const files = this.uploads.get(id) ?? new Map();
    this.uploads.set(id, files);
    const asJson = ([path, file]) => ({
      path,
      sizeBytes: String(file.size),
      sha256: file.sha256,
      offsetBytes: String(file.bytes.length),
      complete: file.bytes.length === file.size,
    });
    if (action === 'start') {
      this.startedWith.set(id, new Map(files));
      this.created.delete(id);
      const workers = this.workers.slice(0, 2).map((worker) => worker.id);
      const simulation = new Simulation({
        id,
        cameras: 24,
        facesPerPart: 4000,
        workers,
        commitsPerSecond: 4,
        startCommitted: 0,
      });
      this.simulations.set(id, simulation);
      return json(response, simulation.reconstruction());
    }
    if (rest[0] !== 'files') return json(response, this.created.get(id));
    if (request.method === 'GET') return json(response, { files: [...files].map(asJson) });
    const part = await bodyOf(request);
    if (this.failNext > 0) {
      this.failNext -= 1;
      return problem(response, 503, 'the store cannot be reached');
    }
    const path = rest.slice(1).join('/');
    const query = Object.fromEntries(url.searchParams);
    let file = files.get(path);
    if (file?.sha256 !== query.sha256)
      file = {
        size: Number(query.size),
        sha256: query.sha256,
        bytes: Buffer.alloc(0),
      };
    if (createHash('sha256').update(part).digest('hex') !== query.partSha256)
      return problem(response, 422, 'partSha256');
    const offset = Number(query.offset);
    if (offset > file.bytes.length) return problem(response, 409, `offset: ${offset}`, 'offset');
    if (offset + part.length > file.bytes.length) file.bytes = Buffer.concat([file.bytes.subarray(0, offset), part]);
    files.set(path, file);
    return json(response, asJson([path, file]));
  }

  one(response, request, url, simulation, action, rest) {
    if (action === 'cancel') {
      if (simulation.state === 'RUNNING') simulation.finish('CANCELLED');
      return json(response, simulation.reconstruction());
    }
    if (request.method === 'DELETE' && rest.length === 0) {
      this.simulations.delete(simulation.reconstruction().id);
      return response.writeHead(204).end();
    }
    switch (rest[0] ?? '') {
      case '':
        return json(response, simulation.reconstruction());
      case 'events':
        return this.events(request, response, simulation);
      case 'cameras':
        return rest[2] === 'photo'
          ? photo(response, simulation, Number(rest[1]))
          : json(response, simulation.camerasJson());
      case 'incidence':
        return json(response, simulation.incidenceJson());
      case 'attempts':
        return json(response, {
          attempts: simulation.attempts.slice(-Number(url.searchParams.get('maxAttempts') || 1000)).reverse(),
        });
      case 'log':
        return json(response, { entries: simulation.log });
      case 'parts': {
        if (rest.length < 2) return json(response, { parts: simulation.parts });
        const preview = simulation.preview(Number(rest[1]), Number(url.searchParams.get('max_faces') ?? 20000));
        if (preview === null) return problem(response, 404, 'sequence: no such part');
        return response.writeHead(200, { 'Content-Type': 'application/octet-stream' }).end(preview);
      }
      default:
        return problem(response, 404, 'no such thing in the simulation');
    }
  }

  events(request, response, simulation) {
    response.writeHead(200, {
      'Content-Type': 'text/event-stream',
      'Cache-Control': 'no-store',
    });
    this.streams.add(response);
    let sequence = Number(request.headers['last-event-id'] ?? 0);
    const send = (event, data) => {
      if (event === 'part') sequence = data.sequence;
      response.write(`id: ${sequence}\nevent: ${event}\ndata: ${JSON.stringify(data)}\n\n`);
      if (event === 'end') response.end();
    };
    response.write('retry: 500\n\n');
    send('reconstruction', simulation.reconstruction());
    for (const part of simulation.parts) if (part.sequence > sequence) send('part', part);
    if (simulation.state !== 'RUNNING') return send('end', {});
    simulation.listeners.add(send);
    const beat = setInterval(() => response.write(': heartbeat\n\n'), 15_000);
    response.on('close', () => {
      clearInterval(beat);
      simulation.listeners.delete(send);
      this.streams.delete(response);
    });
  }

  file(path, response) {
    const name = join(this.page, normalize(path === '/' ? '/index.html' : path));
    if (!name.startsWith(this.page) || !existsSync(name) || !statSync(name).isFile()) {
      return problem(response, 404, 'no such file');
    }
    response.writeHead(200, {
      'Content-Type': TYPES[extname(name)] ?? 'application/octet-stream',
    });
    createReadStream(name).pipe(response);
  }
}

function toOption([group, name, type, unit, preset, [minimum, maximum], documentation]) {
  return { group, name, type, unit, default: preset, minimum, maximum, documentation, tradeOff: 'more: more of it' };
}

async function bodyOf(request) {
  const pieces = [];
  for await (const piece of request) pieces.push(piece);
  return Buffer.concat(pieces);
}

function json(response, value) {
  response.writeHead(200, { 'Content-Type': 'application/json' });
  response.end(JSON.stringify(value));
}

function problem(response, status, detail, field) {
  response.writeHead(status, { 'Content-Type': 'application/problem+json' });
  response.end(
    JSON.stringify({
      type: 'about:blank',
      title: String(status),
      status,
      detail,
      code: '',
      field,
    }),
  );
}

function photo(response, simulation, camera) {
  const hue = (camera * 37) % 360;
  response.writeHead(200, { 'Content-Type': 'image/svg+xml' });
  response.end(`<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 300"><rect width="400" height="300"
    fill="hsl(${hue} 25% 45%)"/><path d="M0 220 90 120l70 70 90-110 150 130v90H0z" fill="hsl(${hue} 30% 30%)"/>
    <text x="14" y="286" font-family="sans-serif" font-size="20" fill="#fff">${simulation.cameras[camera]?.name ?? ''}</text></svg>`);
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const { values } = parseArgs({
    options: Object.fromEntries(
      ['port', 'cameras', 'faces', 'committed', 'rate', 'page'].map((name) => [name, { type: 'string' }]),
    ),
  });
  const numbers = Object.fromEntries(
    Object.entries(values)
      .filter(([name]) => name !== 'page')
      .map(([name, value]) => [name, Number(value)]),
  );
  const page = values.page ?? fileURLToPath(new URL('../../../dashboard/dist', import.meta.url));
  const api = new FakeApi({ ...numbers, page });
  const port = await api.listen(numbers.port ?? 7421);
  console.log(`http://127.0.0.1:${port}/`);
}
