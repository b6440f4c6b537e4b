// SPDX-License-Identifier: Apache-2.0
// Draws tilesets with 3d-tiles-renderer in Chromium, from far and from near, and fails where a tile does not load,
// hardly anything is seen, or nearness does not bring finer tiles. Pictures go to OUT.
// Usage: node show.mjs MODULES OUT FOLDER...   (MODULES: the node_modules; FOLDER: has tileset.json)
import { existsSync, mkdirSync, readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { basename, join, resolve } from 'node:path';

const [modules, out, ...folders] = process.argv.slice(2);
const { chromium } = createRequire(resolve(modules, 'package.json'))('playwright-core');

const PAGE = `<!doctype html><script type="importmap">
{"imports": {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/",
 "3d-tiles-renderer": "/3d-tiles-renderer/build/index.three.js"}}</script>
<body style="margin: 0"><script type="module">
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { TilesRenderer } from '3d-tiles-renderer';

const renderer = new THREE.WebGLRenderer({ preserveDrawingBuffer: true });
renderer.setSize(640, 480);
document.body.replaceChildren(renderer.domElement);

function measure() {
  const gl = renderer.getContext();
  const pixels = new Uint8Array(4 * 640 * 480);
  gl.readPixels(0, 0, 640, 480, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  let covered = 0;
  for (let i = 0; i < pixels.length; i += 4) {
    const [r, g, b] = pixels.subarray(i, i + 3);
    if (r !== 255 || g !== 0 || b !== 255) covered += 1;
  }
  return covered / (640 * 480);
}

// From the distance of so many radii. The names of the tiles that are seen, and the share of the picture.
window.show = async (url, distance) => {
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0xff00ff);
  const camera = new THREE.PerspectiveCamera(45, 4 / 3, 0.1, 1000);
  const tiles = new TilesRenderer(url);
  tiles.manager.addHandler(/\\.glb$/, new GLTFLoader(tiles.manager).setMeshoptDecoder(MeshoptDecoder));
  const errors = [];
  tiles.addEventListener('load-error', ({ error, url }) => errors.push(url + ': ' + error));
  tiles.group.rotation.x = -Math.PI / 2;
  scene.add(tiles.group);
  tiles.setCamera(camera);
  tiles.setResolutionFromRenderer(camera, renderer);
  const sphere = new THREE.Sphere();
  const start = performance.now();
  for (let still = 0; still < 20 && performance.now() - start < 120_000; still += 1) {
    await new Promise(requestAnimationFrame);
    if (tiles.getBoundingSphere(sphere)) {
      sphere.center.applyMatrix4(tiles.group.matrixWorld);
      camera.near = sphere.radius / 100;
      camera.far = sphere.radius * 10;
      const direction = new THREE.Vector3(0, 0.4, 1).normalize();
      camera.position.copy(sphere.center).addScaledVector(direction, distance * sphere.radius);
      camera.lookAt(sphere.center);
      camera.updateProjectionMatrix();
    }
    scene.updateMatrixWorld();
    camera.updateMatrixWorld();
    tiles.update();
    renderer.render(scene, camera);
    if (tiles.loadProgress < 1 || tiles.visibleTiles.size === 0) still = 0;
  }
  const seen = [...tiles.visibleTiles].map((tile) => tile.content.uri.replace(/.*\\//, ''));
  return { share: measure(), seen: seen.sort(), errors };
};
</script>`;

const TYPES = { js: 'text/javascript', json: 'application/json', glb: 'model/gltf-binary' };
const server = createServer((request, response) => {
  if (request.url === '/') return response.setHeader('Content-Type', 'text/html').end(PAGE);
  const [, first, ...rest] = request.url.split('/');
  const file = first === 'tiles' ? join(folders[Number(rest[0])], ...rest.slice(1)) : join(modules, request.url);
  if (!existsSync(file)) return response.writeHead(404).end();
  response.setHeader('Content-Type', TYPES[file.split('.').pop()] ?? 'application/octet-stream');
  response.end(readFileSync(file));
});
await new Promise((listening) => server.listen(0, '127.0.0.1', listening));

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM,
  args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
try {
  mkdirSync(out, { recursive: true });
  const page = await browser.newPage({ viewport: { width: 640, height: 480 } });
  page.setDefaultTimeout(300_000);  // busy machines
  page.on('pageerror', (error) => console.error(error.stack));
  await page.goto(`http://127.0.0.1:${server.address().port}/`);
  await page.waitForFunction('window.show !== undefined');
  for (const [i, folder] of folders.entries()) {
    const depths = [];
    for (const [name, distance] of [['far', 8], ['near', 0.7]]) {
      const { share, seen, errors } = await page.evaluate(
        ([url, radii]) => window.show(url, radii), [`/tiles/${i}/tileset.json`, distance]);
      console.log(`${folder} from ${name}: ${(100 * share).toFixed(1)}% of the picture, ${seen.join(' ')}`);
      await page.screenshot({ path: join(out, `${basename(folder)}-${name}.png`) });
      errors.forEach((error) => console.error(error));
      if (share < 0.005 || seen.length === 0 || errors.length > 0) process.exitCode = 1;
      depths.push(Math.max(...seen.map((tile) => tile.length)));
    }
    if (depths[1] <= depths[0]) process.exitCode = 1;
  }
} finally {
  await browser.close();
  server.close();
}
