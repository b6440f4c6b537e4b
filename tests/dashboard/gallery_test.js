// SPDX-License-Identifier: Apache-2.0
// A reconstruction of one camera, of 47 and of 5,000, in every state, dark and light, on a desktop and on a phone:
// nothing wider than the screen, nothing that cannot be read, and a picture of each to be looked at.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { DESKTOP, DIST, PHONE, keepScreenshot, launch, meshNumbers, openPage, until, violations } from './browser.js';
import { FakeApi } from './fake_api/server.js';

const STATES = {
  running: { state: 'RUNNING' },
  done: { state: 'DONE' },
  failed: { state: 'FAILED', failure: 'images/DJI_0007.JPG: 4000 x 2250 px, but its camera has 4000 x 3000' },
  cancelled: { state: 'CANCELLED' },
};
const SIZES = [1, 47, 5000];
const LOOKS = [
  { name: 'light', colorScheme: 'light', viewport: DESKTOP },
  { name: 'dark', colorScheme: 'dark', viewport: DESKTOP },
  { name: 'phone', colorScheme: 'light', viewport: PHONE },
  { name: 'phone-dark', colorScheme: 'dark', viewport: PHONE },
];

let browser;
let api;
let base;

before(async () => {
  browser = await launch();
  api = new FakeApi({ page: DIST, cameras: 12, faces: 400, committed: 3, rate: 0 });
  for (const cameras of SIZES) {
    for (const [name, how] of Object.entries(STATES)) {
      const startCommitted = name === 'done' ? cameras : Math.floor(cameras / 3);
      api.add({ id: `${name}-${cameras}`, cameras, startCommitted, ...how });
    }
  }
  base = `http://127.0.0.1:${await api.listen()}/`;
});
after(async () => {
  await browser.close();
  api.close();
});

for (const cameras of SIZES) {
  for (const state of Object.keys(STATES)) {
    test(`${state}, ${cameras} cameras`, async (t) => {
      for (const { name, colorScheme, viewport } of LOOKS) {
        const id = `${state}-${cameras}`;
        const page = await openPage(t, browser, `${base}#/reconstructions/${id}`, { colorScheme, viewport });
        await page.locator('.camera-row').first().waitFor();
        const { parts } = api.simulations.get(id);
        const wanted = Math.min(2000, 390 * parts.length);
        await until(async () => (await meshNumbers(page)).shown >= wanted);
        await page.waitForTimeout(500); // the last of it is drawn
        await keepScreenshot(page, `gallery-${id}-${name}`);
        assert.deepEqual(await violations(page), [], name);
        const scroll = await page.evaluate(() => document.documentElement.scrollWidth);
        assert.ok(scroll <= viewport.width, `${scroll} px wide on a screen of ${viewport.width} px, ${name}`);
        await page.context().close();
      }
    });
  }
}
