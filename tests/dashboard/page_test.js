// SPDX-License-Identifier: Apache-2.0
// The page against simulated reconstructions: what it shows, how it is used, who can use it.
import assert from 'node:assert/strict';
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, beforeEach, test } from 'node:test';
import {
  DIST,
  PHONE,
  keepScreenshot,
  launch,
  looksOfCanvas,
  meshNumbers,
  openPage,
  until,
  violations,
} from './browser.js';
import { FakeApi } from './fake_api/server.js';

let browser;
let api;
let base;

before(async () => {
  browser = await launch();
});
after(() => browser.close());
beforeEach(async (context) => {
  api = new FakeApi({
    page: DIST,
    cameras: 300,
    faces: 2000,
    committed: 60,
    rate: 6,
  });
  base = `http://127.0.0.1:${await api.listen()}/`;
  context.after(() => api.close());
});

test('every page and state is free of serious accessibility violations, dark and light, large and small', async (t) => {
  const pages = [
    ['reconstructions', '#/', '.list-row'],
    ['running', '#/reconstructions/campaign', '.camera-row'],
    ['done', '#/reconstructions/done', '.camera-row'],
    ['failed', '#/reconstructions/broken', '.notice.danger'],
    ['missing', '#/reconstructions/nothing', '.notice.danger'],
    ['workers', '#/workers', '.worker'],
    ['submit', '#/submit', '.option'],
    ['unknown', '#/elsewhere', 'h1'],
  ];
  for (const colorScheme of ['light', 'dark']) {
    for (const [name, hash, ready] of pages) {
      const page = await openPage(t, browser, base + hash, { colorScheme });
      await page.locator(ready).first().waitFor();
      if (name === 'running' || name === 'done') await until(async () => (await meshNumbers(page)).shown > 1000);
      await keepScreenshot(page, `${name}-${colorScheme}`, { fullPage: true });
      assert.deepEqual(await violations(page), [], `${name}, ${colorScheme}`);
      await page.setViewportSize(PHONE);
      await page.waitForTimeout(200);
      assert.deepEqual(await violations(page), [], `${name}, ${colorScheme}, phone`);
      const scroll = await page.evaluate(() => document.documentElement.scrollWidth);
      assert.ok(scroll <= PHONE.width, `${name} is ${scroll} px wide on a phone of ${PHONE.width} px`);
      if (colorScheme === 'light') await keepScreenshot(page, `${name}-phone`, { fullPage: true });
      await page.context().close();
    }
  }
});

test('the mesh grows while one looks at it', async (t) => {
  const page = await openPage(t, browser, `${base}#/reconstructions/campaign`);
  const first = await until(async () => {
    const numbers = await meshNumbers(page);
    return numbers.shown > 0 && numbers;
  });
  // How many faces are shown says nothing here: their number falls when frames are slow.
  const then = await until(async () => {
    const numbers = await meshNumbers(page);
    return numbers.parts >= first.parts + 10 && numbers.shown > 0 && numbers;
  });
  assert.ok(then.faces > first.faces);
  const seen = Number((await page.locator('.summary dd').first().textContent()).split(' ')[0]);
  await until(async () => Number((await page.locator('.summary dd').first().textContent()).split(' ')[0]) > seen);
});

test('a page whose code cannot be loaded is there once the coordinator is', async (t) => {
  const page = await openPage(t, browser, base);
  await page.getByRole('link', { name: 'done', exact: true }).waitFor();
  let refused = 0;
  const refuse = (route) => {
    refused += 1;
    return route.abort('connectionrefused');
  };
  await page.route(/assets\/workers-/, refuse);
  await page.getByRole('link', { name: 'Workers' }).click();
  await until(() => refused > 0);
  await page.unroute(/assets\/workers-/, refuse);
  await page.locator('.worker').first().waitFor();
});

test('colours switch between photographs, cameras and shape', async (t) => {
  const page = await openPage(t, browser, `${base}#/reconstructions/done`);
  await until(async () => allShown(await meshNumbers(page)));
  await page.getByRole('button', { name: 'Frusta' }).click();
  const looks = {};
  for (const name of ['Photographs', 'Cameras', 'Shape']) {
    await page.getByRole('radio', { name, exact: true }).check({ force: true });
    await page.waitForTimeout(500);
    looks[name] = await looksOfCanvas(page);
    assert.ok(looks[name].drawn > 20_000, `${name}: ${looks[name].drawn} pixels`);
    await keepScreenshot(page, `colours-${name.toLowerCase()}`);
  }
  const distance = (a, b) => Math.hypot(...a.mean.map((value, k) => value - b.mean[k]));
  assert.ok(distance(looks.Photographs, looks.Cameras) > 15);
  assert.ok(distance(looks.Cameras, looks.Shape) > 15);
});

test('a broken event stream comes back by itself and misses nothing', async (t) => {
  const page = await openPage(t, browser, `${base}#/reconstructions/campaign`);
  await until(async () => (await meshNumbers(page)).parts > 0);
  api.breakStreams();
  await page.getByText('Reconnecting').waitFor();
  await page.getByText('Reconnecting').waitFor({ state: 'detached' });
  await until(async () => {
    const { parts } = await meshNumbers(page);
    return Math.abs(parts - api.simulations.get('campaign').parts.length) <= 6 && parts > 0;
  });
});

test('everything can be reached and done with the keyboard alone', async (t) => {
  const page = await openPage(t, browser, base);
  await page.locator('.list-row').first().waitFor();
  await page.keyboard.press('Tab');
  assert.equal(await page.evaluate(() => document.activeElement.textContent.trim()), 'Skip to the content');
  await page.keyboard.press('Enter');
  await page.keyboard.press('Tab');
  const focused = () => page.evaluate(() => document.activeElement.textContent.trim());
  for (let i = 0; i < 20 && (await focused()) !== 'done'; ++i) await page.keyboard.press('Tab');
  await page.keyboard.press('Enter');
  await page.locator('.camera-row').first().waitFor();
  assert.equal(await focused(), 'done', 'the heading has the focus');
  await until(async () => allShown(await meshNumbers(page)));

  const tabTo = async (selector) => {
    for (let i = 0; i < 40; ++i) {
      await page.keyboard.press('Tab');
      if (await page.evaluate((wanted) => document.activeElement.matches(wanted), selector)) return;
    }
    throw new Error(`the Tab key does not lead to ${selector}`);
  };
  await tabTo('.menu summary');
  await page.keyboard.press('Enter');
  await page.getByText('Mesh, PLY').waitFor();
  await page.keyboard.press('Escape');
  await page.getByText('Mesh, PLY').waitFor({ state: 'hidden' });

  await tabTo('.stage canvas');
  const before = await page.locator('.stage canvas').screenshot();
  for (const key of ['ArrowLeft', 'ArrowLeft', 'ArrowUp', '+']) await page.keyboard.press(key);
  await page.waitForTimeout(400);
  assert.notDeepEqual(await page.locator('.stage canvas').screenshot(), before, 'the view has turned');

  await tabTo('.camera-list');
  for (const key of ['ArrowDown', 'ArrowDown', 'ArrowDown', 'Enter']) await page.keyboard.press(key);
  await page.getByRole('heading', { name: 'DJI_0003.JPG' }).waitFor();
  await page.locator('.photo img').waitFor();
  await page.locator('.chips button').first().waitFor();
  await keepScreenshot(page, 'camera');
  assert.deepEqual(await violations(page), []);
  await page.keyboard.press('Enter'); // back, which has the focus
  await page.locator('.camera-list').waitFor();
});

test('a photograph lies over the surface where its camera stood, until one moves on', async (t) => {
  const page = await openPage(t, browser, `${base}#/reconstructions/done`);
  await until(async () => allShown(await meshNumbers(page)));
  const button = page.getByRole('button', { name: 'Look through' });
  assert.ok(await button.isDisabled());
  assert.match(await button.getAttribute('title'), /Select a camera first/);
  await page.locator('.camera-row').nth(4).click();
  await button.click();
  const photograph = page.locator('.stage-photo');
  await until(() => photograph.evaluate((image) => image.complete && image.naturalWidth > 0));
  const [over, canvas] = [await photograph.boundingBox(), await page.locator('.stage canvas').boundingBox()];
  assert.ok(Math.abs(over.width / over.height - 4 / 3) < 0.01, 'of the shape of the photograph');
  assert.ok(over.x >= canvas.x - 1 && over.y >= canvas.y - 1, 'on the canvas');
  await keepScreenshot(page, 'look-through');
  assert.deepEqual(await violations(page), []);
  await page.getByLabel('Photograph', { exact: true }).fill('0');
  assert.equal(await photograph.evaluate((image) => getComputedStyle(image).opacity), '0');
  const alone = await page.locator('.stage canvas').screenshot();
  await page.locator('.stage canvas').press('ArrowLeft');
  await photograph.waitFor({ state: 'detached' });
  await until(async () => !alone.equals(await page.locator('.stage canvas').screenshot()));
});

test('a distance is measured between two points of the surface', async (t) => {
  const page = await openPage(t, browser, `${base}#/reconstructions/done`);
  await until(async () => allShown(await meshNumbers(page)));
  await page.locator('.camera-row').nth(4).click();
  await page.getByRole('button', { name: 'Look through' }).click();
  await page.getByLabel('Photograph', { exact: true }).fill('0');
  await page.getByRole('button', { name: 'Measure' }).click();
  await page.getByText('Click a point of the surface').waitFor();
  const photograph = await page.locator('.stage-photo').boundingBox();
  const clickAt = (x, y) => page.mouse.click(photograph.x + x * photograph.width, photograph.y + y * photograph.height);
  await clickAt(0.3, 0.5);
  await page.getByText('Click another one').waitFor();
  await clickAt(0.7, 0.5);
  await page.getByText('units of the scene').waitFor();
  await keepScreenshot(page, 'measured');
  // Straight down from 22 units: 0.4 of 4,000 px at a focal length of 3,600 px, on hills of a few units.
  const flat = (22 * 0.4 * 4000) / 3600;
  const distance = Number(await page.locator('[data-distance]').getAttribute('data-distance'));
  assert.ok(distance > 0.6 * flat && distance < 1.4 * flat, `${distance} where flat ground has ${flat}`);
  await page.getByRole('button', { name: 'Measure' }).click();
  await page.locator('[data-distance]').waitFor({ state: 'detached' });
});

test('a box is cropped and reconstructed again, with the options as they were', async (t) => {
  const page = await openPage(t, browser, `${base}#/reconstructions/done`);
  await until(async () => allShown(await meshNumbers(page)));
  await page.getByRole('button', { name: 'Crop' }).click();
  const least = page.getByLabel('Least x');
  await until(async () => Number(await page.getByLabel('Least y').getAttribute('max')) > 15); // six rows of 4 units
  const [from, to] = [Number(await least.getAttribute('min')), Number(await least.getAttribute('max'))];
  await least.focus();
  for (let i = 0; i < 10; ++i) await page.keyboard.press('ArrowRight');
  await keepScreenshot(page, 'crop');
  assert.deepEqual(await violations(page), []);
  const [download] = await Promise.all([
    page.waitForEvent('download'),
    page.getByRole('button', { name: 'Download region.json' }).click(),
  ]);
  const region = JSON.parse(readFileSync(await download.path()));
  assert.equal(region.length, 6);
  assert.ok(Math.abs(region[0] - (from + (10 * (to - from)) / 200)) < 1e-3 * (to - from), `${region} of ${from} to ${to}`);

  await page.getByRole('button', { name: 'Again, this box alone' }).click();
  await page.getByText('which are not uploaded again').waitFor();
  assert.deepEqual(await violations(page), []);
  await page.getByLabel('Name', { exact: true }).fill('the-box');
  await page.getByRole('button', { name: 'Submit', exact: true }).click();
  await page.getByRole('heading', { name: 'the-box' }).waitFor();
  const files = api.startedWith.get('the-box');
  assert.deepEqual([...files.keys()], ['region.json']);
  assert.deepEqual(JSON.parse(String(files.get('region.json').bytes)), region);
});

test('a running reconstruction can be cancelled, after a question', async (t) => {
  const page = await openPage(t, browser, `${base}#/reconstructions/second-flight`);
  await page.getByRole('button', { name: 'Cancel', exact: true }).click();
  assert.deepEqual(await violations(page), []);
  await page.getByRole('button', { name: 'Keep it' }).click();
  assert.equal(api.simulations.get('second-flight').state, 'RUNNING');
  await page.getByRole('button', { name: 'Cancel', exact: true }).click();
  await page.getByRole('button', { name: 'Cancel it' }).click();
  await page.locator('.badge', { hasText: 'Cancelled' }).waitFor();
  assert.equal(api.simulations.get('second-flight').state, 'CANCELLED');

  // What is over can be removed.
  await page.getByRole('button', { name: 'Delete', exact: true }).click();
  assert.deepEqual(await violations(page), []);
  await page.getByRole('button', { name: 'Keep it' }).click();
  assert.ok(api.simulations.has('second-flight'));
  await page.getByRole('button', { name: 'Delete', exact: true }).click();
  await page.getByRole('button', { name: 'Delete it' }).click();
  await page.getByRole('heading', { name: 'Reconstructions' }).waitFor();
  assert.ok(!api.simulations.has('second-flight'));
});

test('a worker can be drained', async (t) => {
  const page = await openPage(t, browser, `${base}#/workers`);
  await page.getByRole('button', { name: 'Drain worker-2' }).click();
  await page.getByRole('button', { name: 'Drain it' }).click();
  await page.locator('.worker', { hasText: 'worker-2' }).getByText('Drained').waitFor();
  assert.ok(api.workers[1].draining);
});

// So much of each of the 60 parts as this machine can draw.
function allShown({ parts, shown, complete }) {
  return parts === 60 && complete && shown > 60 * 8;
}

function makeFolder(t, files) {
  const folder = mkdtempSync(join(tmpdir(), 'meshwright-dashboard-'));
  t.after(() => rmSync(folder, { recursive: true }));
  for (const [path, bytes] of Object.entries(files)) {
    mkdirSync(join(folder, 'My Castle', path, '..'), { recursive: true });
    writeFileSync(join(folder, 'My Castle', path), bytes);
  }
  return join(folder, 'My Castle');
}

test('a folder is uploaded in parts, through interruptions, and its reconstruction opens', async (t) => {
  const large = Buffer.alloc((20 << 20) + 17, 'photograph');
  const folder = makeFolder(t, {
    'cameras.txt': '# cameras',
    'images/a.jpg': large,
    'images/b.jpg': 'b',
    '.DS_Store': 'x',
  });
  const page = await openPage(t, browser, `${base}#/submit`);
  await page.locator('#folder-input').setInputFiles(folder);
  await page.getByText('COLMAP scene').waitFor();
  assert.equal(await page.getByLabel('Name', { exact: true }).inputValue(), 'my-castle');
  await page.getByLabel('window').fill('2');
  api.failNext = 2;
  await page.getByRole('button', { name: 'Submit', exact: true }).click();
  await page.getByText('trying again in').waitFor();
  await page.getByRole('heading', { name: 'my-castle' }).waitFor({ timeout: 30_000 });
  const files = api.uploads.get('my-castle');
  assert.deepEqual([...files.keys()].sort(), ['cameras.txt', 'images/a.jpg', 'images/b.jpg']);
  assert.ok(files.get('images/a.jpg').bytes.equals(large));
  assert.deepEqual(api.optionsOf.get('my-castle'), { window: 2 });
  await until(async () => (await meshNumbers(page)).parts > 3);
});
