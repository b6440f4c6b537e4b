// SPDX-License-Identifier: Apache-2.0
// Draws GLB files with three.js in Chromium, each once from in front and above, and fails where a file does not load or
// hardly anything of it is seen. Pictures go to OUT.
// Usage: node show.mjs MODULES OUT FILE...   (MODULES: the node_modules with three and playwright-core)
import { mkdirSync, readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { basename, join, resolve } from 'node:path';

const [modules, out, ...files] = process.argv.slice(2);
const { chromium } = createRequire(resolve(modules, 'package.json'))('playwright-core');

const PAGE = `<!doctype html><script type="importmap">
{"imports": {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/"}}</script>
<body style="margin: 0"><script type="module">
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
window.show = async (url) => {
  const { scene: model } = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).loadAsync(url);
  const renderer = new THREE.WebGLRenderer({ preserveDrawingBuffer: true });
  renderer.setSize(640, 480);
  document.body.replaceChildren(renderer.domElement);
  const { center, radius } = new THREE.Box3().setFromObject(model).getBoundingSphere(new THREE.Sphere());
  const camera = new THREE.PerspectiveCamera(45, 4 / 3, radius / 100, radius * 10);
  camera.position.copy(center).addScaledVector(new THREE.Vector3(0, 0.5, 1).normalize(), 2.2 * radius);
  camera.lookAt(center);
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0xff00ff);
  let textured = false;
  model.traverse(({ material }) => {
    if (!material) return;
    material.side = THREE.DoubleSide;
    textured ||= material.map !== null;
  });
  scene.add(model);
  renderer.render(scene, camera);
  const gl = renderer.getContext();
  const pixels = new Uint8Array(4 * 640 * 480);
  gl.readPixels(0, 0, 640, 480, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  const colors = new Set();
  let covered = 0;
  for (let i = 0; i < pixels.length; i += 4) {
    const [r, g, b] = pixels.subarray(i, i + 3);
    if (r === 255 && g === 0 && b === 255) continue;
    covered += 1;
    colors.add((r << 16) | (g << 8) | b);
  }
  return { share: covered / (640 * 480), colors: colors.size, textured };
};
</script>`;

const served = new Map(files.map((file, i) => [`/${i}.glb`, file]));
const server = createServer((request, response) => {
  if (request.url === '/') return response.setHeader('Content-Type', 'text/html').end(PAGE);
  const file = served.get(request.url) ?? (request.url.startsWith('/three/') ? join(modules, request.url) : undefined);
  if (file === undefined) return response.writeHead(404).end();
  response.setHeader('Content-Type', file.endsWith('.js') ? 'text/javascript' : 'model/gltf-binary');
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
  page.on('pageerror', (error) => console.error(error.stack));
  await page.goto(`http://127.0.0.1:${server.address().port}/`);
  await page.waitForFunction('window.show !== undefined');
  for (const [url, file] of served) {
    const { share, colors, textured } = await page.evaluate((address) => window.show(address), url);
    console.log(`${file}: ${(100 * share).toFixed(1)}% of the picture, ${colors} colours`);
    await page.screenshot({ path: join(out, `${basename(file, '.glb')}.png`) });
    if (share < 0.02 || (textured && colors < 100)) process.exitCode = 1;
  }
} finally {
  await browser.close();
  server.close();
}
