// SPDX-License-Identifier: Apache-2.0
// The page against a real coordinator with two workers, from a folder of photographs to the downloaded mesh.
import assert from 'node:assert/strict';
import { spawn, spawnSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { DIST, keepScreenshot, launch, looksOfCanvas, meshNumbers, openPage, until, violations } from './browser.js';

const MESHWRIGHT =
  process.env.MESHWRIGHT ?? fileURLToPath(new URL('../../build/release/bin/meshwright', import.meta.url));
const TIMEOUT = { timeout: 240_000 };

let browser;
let folder;
let service;
let base = '';

before(async () => {
  folder = mkdtempSync(join(tmpdir(), 'meshwright-dashboard-'));
  const scene = ['--cameras', '20', '--width', '560', '--height', '420', '--quiet'];
  const made = spawnSync(MESHWRIGHT, ['synthesize', 'facade', '-o', join(folder, 'facade'), ...scene]);
  assert.equal(made.status, 0, String(made.stderr));
  const places = ['--data', join(folder, 'data'), '--dashboard', DIST];
  const ports = ['--listen', '127.0.0.1:0', '--rest-listen', '127.0.0.1:0', '--workers', '2'];
  service = spawn(MESHWRIGHT, ['up', ...places, ...ports], { stdio: ['ignore', 'pipe', 'inherit'] });
  let said = '';
  service.stdout.on('data', (text) => (said += text));
  base = await until(() => {
    assert.equal(service.exitCode, null, 'meshwright up has ended');
    return /dashboard is at (\S+)/.exec(said)?.[1];
  });
  browser = await launch();
});
after(async () => {
  await browser?.close();
  if (service !== undefined && service.exitCode === null) {
    const ended = new Promise((resolve) => service.once('exit', resolve));
    service.kill('SIGTERM');
    await ended;
  }
  rmSync(folder, { recursive: true, force: true });
});

async function submit(page, name, options = []) {
  await page.goto(`${base}#/submit`);
  await page.locator('.option').first().waitFor();
  await page.locator('#folder-input').setInputFiles(join(folder, 'facade'));
  await page.getByText('COLMAP scene').waitFor();
  await page.getByLabel('Name', { exact: true }).fill(name);
  for (const [group, option, value] of options) {
    await page.locator('.option-group summary', { hasText: group }).click();
    await page.locator(`#option-${option}`).fill(value);
  }
  await page.getByRole('button', { name: 'Submit', exact: true }).click();
  await page.getByRole('heading', { name }).waitFor(TIMEOUT);
}

const stateOf = (page) => page.locator('.page-head .badge').first().textContent();

test('from a dropped folder to the downloaded mesh', { timeout: 600_000 }, async (t) => {
  const page = await openPage(t, browser, base);
  await submit(page, 'facade', [['Joining', 'min-component', '50']]);

  // While it runs: progress moves, the mesh grows, by numbers and by pixels.
  await until(async () => (await meshNumbers(page)).shown > 0, TIMEOUT);
  // The surface alone, from a place that stays.
  await page.locator('.stage canvas').focus();
  for (const key of ['c', 'ArrowLeft', 'ArrowRight']) await page.keyboard.press(key);
  const seen = [];
  await until(async () => {
    const numbers = await meshNumbers(page);
    if (numbers.shown > 0 && numbers.shown !== seen.at(-1)?.shown)
      seen.push({ ...numbers, ...(await looksOfCanvas(page)) });
    return (await stateOf(page)) === 'Done';
  }, TIMEOUT);
  console.log(
    `# parts seen: ${seen.map(({ parts }) => parts).join(' ')}; faces: ${seen.map(({ faces }) => faces).join(' ')}`,
  );
  assert.ok(seen.length >= 2, `${seen.length} states of the mesh were seen`);
  assert.ok(seen.at(-1).parts > seen[0].parts);
  assert.ok(seen.at(-1).faces > seen[0].faces);
  // How much more depends on how much there was when it was looked at first.
  const grown = seen.at(-1).faces > 2 * seen[0].faces ? 1.05 : 1;
  assert.ok(seen.at(-1).drawn > grown * seen[0].drawn, `${seen[0].drawn}, then ${seen.at(-1).drawn} pixels`);

  // What it took is in the charts.
  await page.getByText(/mean of \d+ cameras/).waitFor();
  await page
    .getByText(/attempts on \d workers/)
    .first()
    .waitFor();

  // The one mesh takes the place of the surfaces: it covers what they covered, in their colours.
  const color = (name) => page.getByRole('radio', { name, exact: true }).check({ force: true });
  const differsFrom = async ({ mean }) => {
    const now = await looksOfCanvas(page);
    return Math.hypot(...now.mean.map((value, k) => value - mean[k]));
  };
  await until(async () => {
    const { tiles, complete } = await meshNumbers(page);
    return tiles > 0 && complete;
  }, TIMEOUT);
  await page.getByText(/The mesh: .* triangles/).waitFor();
  const photo = await looksOfCanvas(page);
  assert.ok(photo.drawn > 0.9 * seen.at(-1).drawn, `${seen.at(-1).drawn} pixels, then ${photo.drawn}`);
  assert.ok((await differsFrom(seen.at(-1))) < 12, 'the mesh has the colours of the surfaces');
  await keepScreenshot(page, 'service-mesh');
  await color('Shape');
  await until(async () => (await differsFrom(photo)) > 10);
  await keepScreenshot(page, 'service-mesh-shape');

  // What it came to, in shares that add up.
  const verdict = (await (await fetch(`${base}v1/reconstructions/facade`)).json()).verdict;
  const fates = ['coverage', 'blind', 'inconsistent', 'unsupported', 'contradicted'];
  const sum = fates.reduce((all, name) => all + (verdict[name] ?? 0), 0);
  assert.ok(Math.abs(sum - 1) < 1e-6, `shares add up to ${sum}`);
  assert.ok(verdict.coverage > 0.5 && verdict.inferred <= verdict.coverage, JSON.stringify(verdict));
  await page.getByText(`${(100 * verdict.coverage).toFixed(0)} % covered`).waitFor();

  // Who made what: the surfaces again, side by side.
  await color('Cameras');
  await page.getByText(/Surfaces of \d+ cameras, side by side/).waitFor();
  await until(async () => (await differsFrom(photo)) > 10);
  await keepScreenshot(page, 'service-cameras', { fullPage: true });

  // A camera: its photograph, its neighbours, its numbers.
  await page.locator('.camera-row').first().click();
  await until(() => page.locator('.photo img').evaluate((image) => image.complete && image.naturalWidth > 100));
  await page.locator('.chips button').first().waitFor();
  await page.locator('.camera-details').getByText('Grown', { exact: true }).waitFor();
  await keepScreenshot(page, 'service-camera');
  assert.deepEqual(await violations(page), []);

  // The mesh, as it is downloaded here and as the API has it.
  await page.locator('.menu summary').click();
  const [download] = await Promise.all([page.waitForEvent('download'), page.getByText('Mesh, PLY').click()]);
  const bytes = readFileSync(await download.path());
  const answer = await fetch(`${base}v1/reconstructions/facade/mesh`);
  assert.ok(bytes.equals(Buffer.from(await answer.arrayBuffer())));
  const { meshSha256, progress } = await (await fetch(`${base}v1/reconstructions/facade`)).json();
  assert.equal(createHash('sha256').update(bytes).digest('hex'), meshSha256);
  assert.equal(/element face (\d+)/.exec(bytes.subarray(0, 1000).toString('latin1'))[1], progress.faces);
  assert.equal(download.suggestedFilename(), 'facade.ply');
});

test('a box of it is reconstructed again, from the photographs that are there', { timeout: 600_000 }, async (t) => {
  const page = await openPage(t, browser, `${base}#/reconstructions/facade`);
  await until(async () => (await meshNumbers(page)).complete, TIMEOUT);
  await page.getByRole('button', { name: 'Crop' }).click();
  await page.getByLabel('Least x').focus();
  for (let i = 0; i < 120; ++i) await page.keyboard.press('ArrowRight');
  const share = await page
    .getByLabel('Least x')
    .evaluate(({ min, max, value }) => (Number(value) - Number(min)) / (Number(max) - Number(min)));
  assert.ok(Math.abs(share - 0.6) < 0.02, `120 of 200 steps are ${share} of the width`);
  await page.getByRole('button', { name: 'Again, this box alone' }).click();
  await page.getByText('which are not uploaded again').waitFor();
  await page.locator('.option').first().waitFor();
  assert.equal(await page.locator('#option-min-component').inputValue(), '50', 'the options are those of before');
  await page.getByLabel('Name', { exact: true }).fill('facade-box');
  await page.getByRole('button', { name: 'Submit', exact: true }).click();
  await page.getByRole('heading', { name: 'facade-box' }).waitFor(TIMEOUT);
  await until(async () => (await stateOf(page)) === 'Done', TIMEOUT);
  const facesOf = async (id) => Number((await (await fetch(`${base}v1/reconstructions/${id}`)).json()).progress.faces);
  const [box, whole] = [await facesOf('facade-box'), await facesOf('facade')];
  assert.ok(box > 0.2 * whole && box < 0.6 * whole, `${box} of ${whole} triangles`);
});

test('another one is cancelled from the page', { timeout: 300_000 }, async (t) => {
  const page = await openPage(t, browser, base);
  await submit(page, 'unwanted');
  await page.getByRole('button', { name: 'Cancel', exact: true }).click();
  await page.getByRole('button', { name: 'Cancel it' }).click();
  await page.locator('.badge', { hasText: 'Cancelled' }).waitFor(TIMEOUT);
  const { state } = await (await fetch(`${base}v1/reconstructions/unwanted`)).json();
  assert.equal(state, 'RECONSTRUCTION_STATE_CANCELLED');
  await page.goto(`${base}#/workers`);
  await page.locator('.worker').nth(1).waitFor();
  assert.deepEqual(await violations(page), []);
  await keepScreenshot(page, 'service-workers');
});
