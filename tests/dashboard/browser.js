// SPDX-License-Identifier: Apache-2.0
// One Chromium for a test file, and what the tests look at pages with.
import { existsSync, mkdirSync, readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';

export const DIST = fileURLToPath(new URL('../../dashboard/dist', import.meta.url));
// Pictures of pages, to be looked at.
const ARTEFACTS = process.env.DASHBOARD_ARTEFACTS ?? fileURLToPath(new URL('../../build/dashboard', import.meta.url));
const AXE = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');

export const PHONE = { width: 390, height: 844 };
export const DESKTOP = { width: 1440, height: 900 };

export function launch() {
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
    args: [
      '--no-sandbox',
      '--disable-quic',
      '--no-first-run',
      '--disable-background-networking',
      '--disable-component-update',
      '--disable-sync',
      // No graphics card: WebGL in software.
      '--use-angle=swiftshader',
      '--enable-unsafe-swiftshader',
    ],
  });
}

// A page whose errors fail the test that it belongs to, at its end.
export async function openPage(test, browser, url, { viewport = DESKTOP, colorScheme = 'light' } = {}) {
  const context = await browser.newContext({
    viewport,
    colorScheme,
    acceptDownloads: true,
    reducedMotion: 'reduce',
  });
  const page = await context.newPage();
  const errors = [];
  page.on('pageerror', (error) => errors.push(error.stack));
  test.after(async () => {
    await context.close();
    if (errors.length > 0) throw new Error(`errors of the page:\n${errors.join('\n')}`);
  });
  await page.goto(url);
  return page;
}

export async function keepScreenshot(page, name, { fullPage = false } = {}) {
  mkdirSync(ARTEFACTS, { recursive: true });
  await page.screenshot({ path: join(ARTEFACTS, `${name}.png`), fullPage });
}

// Serious and critical violations, as lines of text.
export async function violations(page) {
  await page.evaluate(AXE);
  const { violations: found } = await page.evaluate(() =>
    globalThis.axe.run(document, { resultTypes: ['violations'] }),
  );
  return found
    .filter(({ impact }) => impact === 'serious' || impact === 'critical')
    .flatMap(({ id, nodes }) => nodes.map((node) => `${id}: ${node.html.slice(0, 160)} (${node.failureSummary})`));
}

// Triangles, parts and what is shown of them, as the page says.
export function meshNumbers(page) {
  return page.locator('.stage-numbers').evaluate(({ dataset }) => ({
    parts: Number(dataset.parts),
    faces: Number(dataset.faces),
    shown: Number(dataset.shown),
    tiles: Number(dataset.tiles),
    complete: dataset.complete === 'true',
  }));
}

// What is on the canvas: pixels that are not background, and their mean colour.
export async function looksOfCanvas(page) {
  const png = await page.locator('.stage canvas').screenshot();
  return page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const picture = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
    // Not the edges, where buttons and legends lie.
    const [left, top] = [Math.round(picture.width * 0.05), Math.round(picture.height * 0.15)];
    const [width, height] = [picture.width - 2 * left, picture.height - 2 * top];
    const context = new OffscreenCanvas(width, height).getContext('2d');
    context.drawImage(picture, -left, -top);
    const { data } = context.getImageData(0, 0, width, height);
    const text = getComputedStyle(document.documentElement).getPropertyValue('--stage').trim().slice(1);
    const background = [0, 2, 4].map((at) => parseInt(text.slice(at, at + 2), 16));
    let drawn = 0;
    const sums = [0, 0, 0];
    for (let i = 0; i < data.length; i += 4) {
      if ([0, 1, 2].every((k) => Math.abs(data[i + k] - background[k]) < 12)) continue;
      drawn += 1;
      for (let k = 0; k < 3; ++k) sums[k] += data[i + k];
    }
    return { drawn, mean: sums.map((sum) => sum / Math.max(drawn, 1)) };
  }, png.toString('base64'));
}

export async function until(condition, { timeout = 45_000, every = 100, what = String(condition) } = {}) {
  const deadline = Date.now() + timeout;
  for (;;) {
    const value = await condition();
    if (value) return value;
    if (Date.now() > deadline) throw new Error(`did not come true within ${timeout} ms: ${what}`);
    await new Promise((resolve) => setTimeout(resolve, every));
  }
}

if (!existsSync(join(DIST, 'index.html'))) throw new Error('dashboard/dist is not there: run scripts/build-dashboard');
