// The viewer in a real browser against a real daemon with a simulated map. Nothing here passes or fails on time.

import assert from 'node:assert/strict';
import fs from 'node:fs';
import path from 'node:path';
import { after, before, test } from 'node:test';
import {
  canvasOf, countPixels, differing, like, newPage, notePointsDrawn, openBrowser, pictureOf, pointAt, pointsDrawn,
  seriousFaults, settled,
} from './browser.mjs';
import { Daemon, scratch, simulate, until } from './daemon.mjs';

const background = [11, 15, 21];
const appeared = [61, 220, 151];
const disappeared = [255, 93, 115];

const directory = scratch();
const daemon = new Daemon(directory);
let browser;
let days;

const upload = (day, flags = []) =>
  daemon.cli(['session', 'upload', 'yard', days[day - 1], '--id', `day-${day}`, '--robot', `robot-${day}`, '--wait', ...flags]);

before(async () => {
  await daemon.start();
  days = await simulate(path.join(directory, 'street'), { sessions: 3, more: ['--change', '0.6'] });
  await daemon.cli(['map', 'create', 'yard']);
  await upload(1);
  await upload(2);
  browser = await openBrowser();
});

after(async () => {
  await browser?.close();
  await daemon.stop();
  fs.rmSync(directory, { recursive: true, force: true });
});

async function open(address = '#/yard/map', options = {}) {
  const page = await newPage(browser, options);
  await page.goto(`${daemon.url}/${address}`);
  return page;
}

const isBackground = like(background, 12);
const drawnPixels = (picture) => countPixels(picture, (r, g, b) => !isBackground(r, g, b));

test('the page draws the map, and another colouring draws other colours', async () => {
  const page = await open('');
  await settled(page, 2);
  assert.match(page.url(), /#\/yard\/map/, 'the only map opens by itself');
  const byHeight = await pictureOf(page);
  const area = byHeight.width * byHeight.height;
  assert.ok(drawnPixels(byHeight) > 0.03 * area, `only ${drawnPixels(byHeight)} of ${area} pixels show the map`);

  await page.getByText('Ground', { exact: true }).click();
  const byGround = await until(async () => {
    const picture = await pictureOf(page);
    return differing(picture, byHeight) > 0.01 * area && picture;
  }, 'other colours');
  const blue = countPixels(byGround, (r, g, b) => b > r + 30 && b > 60);
  const sand = countPixels(byGround, (r, g, b) => r > b + 30 && r > 60);
  assert.ok(blue > 0.003 * area, `${blue} pixels are coloured as ground`);
  assert.ok(sand > 0.003 * area, `${sand} pixels are coloured as standing on it`);

  const pictures = new Map();
  for (const name of ['Stability R', 'Age', 'Intensity', 'Height']) {
    await page.getByText(name, { exact: true }).first().click();
    await settled(page, 2);
    pictures.set(name, await pictureOf(page));
  }
  assert.ok(differing(pictures.get('Stability R'), pictures.get('Intensity')) > 0.005 * area);
  assert.ok(differing(pictures.get('Age'), pictures.get('Intensity')) > 0.005 * area);
  assert.ok(differing(pictures.get('Height'), byHeight) < 0.002 * area, 'the same colouring draws the same picture');
  assert.deepEqual(page.wrong, []);
  await page.context().close();
});

test('the slider shows earlier epochs, and the newest again', async () => {
  const page = await open();
  await settled(page, 2);
  const now = await pictureOf(page);
  const slider = page.getByRole('slider', { name: 'Epoch' });
  await slider.focus();
  await slider.press('Home');
  await settled(page, 1);
  assert.match(page.url(), /epoch=1/);
  const then = await pictureOf(page);
  assert.ok(differing(now, then) > 300, `epoch 1 looks as epoch 2: ${differing(now, then)} pixels differ`);
  await slider.press('End');
  await settled(page, 2);
  const again = differing(now, await pictureOf(page));
  assert.ok(again < 100, `epoch 2 does not look as it did before: ${again} pixels differ`);
  assert.deepEqual(page.wrong, []);
  await page.context().close();
});

test('the page of changes counts and shows what appeared and disappeared', async () => {
  const page = await open('#/yard/changes');
  await settled(page, 2);
  const numbers = page.locator('.kinds b');
  await until(async () => !(await numbers.allTextContents()).includes('…'), 'the counts');
  const shown = (await numbers.allTextContents()).map((text) => Number(text.replaceAll(',', '')));
  const told = await daemon.json(['map', 'diff', 'yard', 1, 2]);
  assert.equal(shown[0], Number(told.appeared));
  assert.equal(shown[1], Number(told.disappeared));
  assert.ok(shown[0] > 0 && shown[1] > 0, 'cars came and went');

  const bright = (picture, colour) => countPixels(picture, (r, g, b) => {
    const size = Math.hypot(r, g, b);
    return size > 60 && Math.hypot(...colour) > 0 &&
      (r * colour[0] + g * colour[1] + b * colour[2]) / (size * Math.hypot(...colour)) > 0.985;
  });
  const picture = await pictureOf(page);
  const [green, red] = [bright(picture, appeared), bright(picture, disappeared)];
  assert.ok(green > 50, `${green} pixels show what appeared`);
  assert.ok(red > 50, `${red} pixels show what disappeared`);
  await page.getByRole('checkbox', { name: /Disappeared/ }).uncheck();
  await until(async () => bright(await pictureOf(page), disappeared) < red / 4, 'the red to go');
  assert.deepEqual(page.wrong, []);
  await page.context().close();
});

test('a click asks for the voxel under it, as mapkeep query does', async () => {
  const page = await open();
  await settled(page, 2);
  await page.getByRole('button', { name: 'From above' }).click();
  await settled(page, 2);
  await pointAt(page, 0.3, isBackground);
  const card = page.getByRole('region', { name: 'Voxel' });
  await card.getByText('Hits H').waitFor();
  const [x, y, z] = (await card.locator('.coordinates').textContent()).trim().split(/\s+/);
  const told = await daemon.json(['query', 'yard', x, y, z]);
  const fact = async (name) => card.locator(`dt:text-is("${name}") + dd`).textContent();
  assert.equal(await fact('Stability R'), Number(told.stability).toFixed(3));
  assert.equal(await fact('Hits H'), `${Number(told.hits).toFixed(1)} scans`);
  assert.equal(await fact('Ground'), told.ground ? 'yes' : 'no');
  await page.keyboard.press('Escape');
  await card.waitFor({ state: 'detached' });
  assert.deepEqual(page.wrong, []);
  await page.context().close();
});

test('two clicks measure a distance, whose parts fit together', async () => {
  const page = await open();
  await settled(page, 2);
  await page.keyboard.press('t');
  await page.keyboard.press('m');
  await settled(page, 2);
  await pointAt(page, 0.3, isBackground);
  await page.getByText('Now the second point.').waitFor();
  await pointAt(page, 0.8, isBackground);
  const card = page.getByRole('region', { name: 'Distance' });
  const metres = async (name) => {
    const text = await card.locator(`dt:text-is("${name}") + dd`).textContent();
    const [number, unit] = text.split(' ');
    return Number(number) * (unit === 'cm' ? 0.01 : 1);
  };
  await card.getByText('Along the ground').waitFor();
  const [all, flat, high] = [await metres('Distance'), await metres('Along the ground'), await metres('Height')];
  assert.ok(all > 1, `${all} m`);
  assert.ok(Math.abs(Math.hypot(flat, high) - all) < 0.2, `${flat} m and ${high} m make ${all} m`);
  await page.locator('.measure-label').waitFor();
  await page.context().close();
});

test('the point budget holds, whatever is loaded', async () => {
  const page = await newPage(browser);
  await notePointsDrawn(page);
  await page.goto(`${daemon.url}/#/yard/map`);
  await settled(page, 2);
  const told = async () => Number(await canvasOf(page).getAttribute('data-drawn'));
  const many = (await pointsDrawn(page)).now;
  assert.ok(many > 40_000 && many <= 400_000, `${many} points`);
  assert.equal(many, await told(), 'the page says how many it draws');
  const detail = page.getByRole('slider', { name: 'Detail' });
  await detail.focus();
  await detail.press('Home');
  await until(async () => (await told()) <= 20_000, 'fewer points');
  await settled(page, 2);
  const few = (await pointsDrawn(page)).now;
  assert.ok(few > 4_000 && few <= 20_000, `${few} points are drawn of at most 20,000`);
  assert.equal(few, await told());
  await page.context().close();
});

test('trajectories are drawn with their fitness', async () => {
  const page = await open();
  await settled(page, 2);
  const before = await pictureOf(page);
  await page.getByRole('button', { name: 'Show all' }).click();
  await settled(page, 2);
  // Two drives of 15 m in a map of 200: some pixels a line. Nothing else changes in the picture.
  const lines = await until(async () => {
    const picture = await pictureOf(page);
    return differing(picture, before) > 40 && picture;
  }, 'lines over the map');
  // The first day founded the map and is grey, the second one is green as far as it fits.
  for (const [name, colour] of Object.entries({ grey: [159, 176, 198], green: [100, 208, 149] })) {
    const count = differing(lines, before, 24, like(colour, 45));
    assert.ok(count > 12, `${count} pixels of ${differing(lines, before)} that changed are ${name}`);
  }
  assert.equal(await page.getByRole('checkbox', { name: /day-1/ }).isChecked(), true);
  await page.getByText('founded the map').waitFor();
  await page.getByText(/^fit \d+ %$/).waitFor();
  await page.getByRole('button', { name: 'Hide all' }).click();
  await until(async () => differing(await pictureOf(page), before) < 5, 'the lines to go');
  assert.deepEqual(page.wrong, []);
  await page.context().close();
});

test('a session that commits shows up without a reload', async () => {
  const page = await open();
  await settled(page, 2);
  const sessions = await open('#/yard/sessions');
  await sessions.locator('.session-head', { hasText: 'day-2' }).waitFor();
  await page.evaluate(() => (globalThis.notReloaded = true));
  await page.locator('.live.live').waitFor();
  await sessions.locator('.live.live').waitFor();
  const seen = new Set();
  await sessions.exposeFunction('stateSeen', (state) => seen.add(state));
  await sessions.evaluate(() => {
    const look = () => {
      for (const row of document.querySelectorAll('.session-head')) {
        if (row.textContent.includes('day-3')) globalThis.stateSeen(row.querySelector('.state').textContent);
      }
    };
    new MutationObserver(look).observe(document.body, { subtree: true, childList: true, characterData: true });
  });
  const told = page.getByText('Epoch 3: session day-3 was merged into the map').waitFor({ timeout: 600_000 });
  await upload(3);
  await told;
  await settled(page, 3);
  assert.equal(await page.evaluate(() => globalThis.notReloaded), true);
  await sessions.locator('.session-head', { hasText: 'day-3' }).locator('.state.committed').waitFor();
  assert.ok(seen.has('running'), `the page of sessions showed it ${[...seen].join(', ')}`);
  assert.deepEqual([...page.wrong, ...sessions.wrong], []);
  await page.context().close();
  await sessions.context().close();
});

test('any two epochs can be compared, and the address says which', async () => {
  const page = await open('#/yard/changes?from=1');
  await settled(page, 3);
  const counts = async (before, after) => {
    await page.getByRole('heading', { name: `From epoch ${before} to ${after}` }).waitFor();
    const told = await daemon.json(['map', 'diff', 'yard', before, after]);
    const expected = ['appeared', 'disappeared', 'unstable'].map((name) => Number(told[name]));
    const shown = async () =>
      (await page.locator('.kinds b').allTextContents()).map((text) => Number(text.replaceAll(',', '')));
    await until(async () => !(await shown()).some(Number.isNaN), 'the counts');
    assert.deepEqual(await shown(), expected);
    return expected;
  };
  const whole = await counts(1, 3);
  const before = page.getByRole('slider', { name: 'Before' });
  await before.focus();
  await before.press('End');
  assert.match(page.url(), /from=2/);
  const last = await counts(2, 3);
  assert.notDeepEqual(whole, last);
  // What later sessions contradicted, but did not take away yet.
  assert.ok(whole[2] + last[2] > 0, 'something became unstable');
  await page.getByRole('button', { name: /^1 → 2/ }).click();
  await counts(1, 2);
  assert.deepEqual(page.wrong, []);
  await page.context().close();
});

test('the page of sessions tells what was found, and why one was refused', async () => {
  const [stranger] = await simulate(path.join(directory, 'elsewhere'), { scans: 12, seed: 99 });
  // The same coordinates, another street: it fits nowhere.
  await daemon.cli(['session', 'upload', 'yard', stranger, '--id', 'stranger', '--wait'], { fails: true });
  const page = await open('#/yard/sessions');
  const row = page.locator('.session', { hasText: 'stranger' });
  await row.locator('.state.refused').waitFor();
  const told = await daemon.json(['session', 'show', 'yard', 'stranger']);
  assert.equal(await row.locator('.reason').textContent(), told.reason);
  await page.locator('.session-head', { hasText: 'day-2' }).click();
  const report = page.locator('.report');
  for (const stage of ['align', 'clean', 'merge', 'commit']) await report.getByText(stage, { exact: true }).waitFor();
  const day2 = await daemon.json(['session', 'show', 'yard', 'day-2']);
  assert.equal(await report.locator('.windows i').count(), day2.report.windows.length);
  assert.equal(await report.locator('dt:text-is("Points") + dd').textContent(),
    Number(day2.report.points).toLocaleString('en-GB'));
  await report.getByRole('button', { name: 'Show on the map' }).click();
  await settled(page, 2);
  assert.deepEqual(page.wrong, []);
  await page.context().close();
});

test('a phone shows and controls it all', async () => {
  const page = await open('#/yard/map', {
    viewport: { width: 390, height: 780 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2,
  });
  await settled(page);
  const picture = await pictureOf(page);
  assert.ok(drawnPixels(picture) > 0.02 * picture.width * picture.height, `${drawnPixels(picture)} pixels`);
  const layers = page.getByRole('button', { name: 'Layers' });
  await layers.tap();
  await page.getByText('Age', { exact: true }).tap();
  await page.waitForURL(/colour=age/);
  await layers.tap();
  for (const tab of ['Changes', 'Sessions', 'Map']) {
    await page.getByRole('link', { name: tab, exact: true }).tap();
    const wide = await page.evaluate(() => document.documentElement.scrollWidth - window.innerWidth);
    assert.ok(wide <= 0, `${tab} is ${wide} pixels wider than the screen`);
  }
  for (const button of await page.locator('.toolbar button').all()) {
    const box = await button.boundingBox();
    assert.ok(box.width >= 40 && box.height >= 40, 'too small for a finger');
  }
  // A tap becomes a click some time after it was made.
  await settled(page);
  const aslant = await pictureOf(page);
  await page.getByRole('button', { name: 'From above' }).tap();
  await until(async () => differing(await pictureOf(page), aslant) > 500, 'the view from above');
  await settled(page);
  await pointAt(page, 0.5, isBackground, true);
  const card = page.getByRole('region', { name: 'Voxel' });
  await card.getByText(/Hits H|stands for several voxels/).waitFor();
  assert.deepEqual(page.wrong, []);
  await page.context().close();
});

test('keys alone reach the map, its pages and a voxel', async () => {
  const page = await open();
  await settled(page);
  await page.keyboard.press('c');
  await page.getByText(/From epoch/).waitFor();
  await page.keyboard.press('s');
  await page.getByRole('heading', { name: /Sessions/ }).waitFor();
  await page.keyboard.press('s');
  await page.keyboard.press('2');
  assert.match(page.url(), /colour=stability/);
  await page.keyboard.press('[');
  assert.match(page.url(), /epoch=\d/);
  await page.keyboard.press('?');
  await page.getByRole('dialog', { name: 'Keys and gestures' }).waitFor();
  await page.keyboard.press('Escape');
  const before = await settled(page).then(() => pictureOf(page));
  await canvasOf(page).focus();
  for (let i = 0; i < 4; ++i) await page.keyboard.press('ArrowUp');
  await until(async () => differing(await pictureOf(page), before) > 500, 'the map to move');
  await page.context().close();
});

test('axe-core finds no serious fault on any page, wide or narrow', async () => {
  for (const viewport of [{ width: 1200, height: 760 }, { width: 390, height: 780 }]) {
    const page = await open('#/yard/map', { viewport });
    await settled(page);
    const look = async (where) => assert.deepEqual(await seriousFaults(page), [], `${where}, ${viewport.width} wide`);
    if (viewport.width < 700) await page.getByRole('button', { name: 'Layers' }).click();
    await look('map');
    await page.getByRole('link', { name: 'Changes' }).click();
    await page.getByText('Step by step').waitFor();
    await look('changes');
    await page.getByRole('link', { name: 'Sessions' }).click();
    await page.locator('.session-head', { hasText: 'day-2' }).click();
    await look('sessions');
    await page.getByRole('link', { name: 'Mapkeep, all maps' }).click();
    await page.locator('.cards button', { hasText: 'yard' }).waitFor();
    await look('maps');
    await page.goto(`${daemon.url}/#/nowhere/map`);
    await page.getByRole('heading', { name: 'There is no such map' }).waitFor();
    await look('no such map');
    await page.context().close();
  }
});

test('a map without sessions says how it gets one', async () => {
  await daemon.cli(['map', 'create', 'field']);
  const page = await open('#/field/map');
  await page.getByRole('heading', { name: 'This map is still empty' }).waitFor();
  assert.deepEqual(await seriousFaults(page), []);
  assert.deepEqual(page.wrong, []);
  await daemon.cli(['map', 'delete', 'field']);
  await page.context().close();
});

test('when the daemon is gone the page says so, and goes on when it is back', async () => {
  const page = await open();
  await settled(page);
  await page.locator('.live.live').waitFor();
  await page.route('**/v1/**', (route) => route.abort());
  await page.reload();
  await page.getByRole('heading', { name: 'The map cannot be shown' }).waitFor();
  await page.unroute('**/v1/**');
  await page.getByRole('button', { name: 'Try again' }).click();
  await settled(page);
  await page.context().close();
});
