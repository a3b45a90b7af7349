// A real Chromium, drawing with the processor, and what its pictures show.

import fs from 'node:fs';
import { createRequire } from 'node:module';
import { chromium } from 'playwright-core';
import { PNG } from 'pngjs';

const executable = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find((path) => fs.existsSync(path));
const axeSource = fs.readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');

export function openBrowser() {
  if (!executable) throw new Error('no chromium: deploy/install-packages installs it');
  return chromium.launch({
    executablePath: executable,
    // The new headless mode draws WebGL; playwright would ask for the old one.
    ignoreDefaultArgs: ['--headless', '--hide-scrollbars'],
    args: ['--headless=new', '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
      '--ignore-gpu-blocklist', '--disable-background-networking', '--disable-component-update', '--disable-sync',
      '--no-first-run'],
  });
}

/** A page that remembers what went wrong in it. */
export async function newPage(browser, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1200, height: 760 }, ...options });
  const page = await context.newPage();
  page.wrong = [];
  page.setDefaultTimeout(60_000);
  page.on('pageerror', (error) => page.wrong.push(error.message));
  page.on('console', (message) => message.type() === 'error' && page.wrong.push(message.text()));
  return page;
}

/** Lets a page note, from its next loading on, how many points it gives to WebGL: what it draws, not what it says. */
export const notePointsDrawn = (page) => page.addInitScript(() => {
  const frames = { now: 0, last: 0, most: 0 };
  globalThis.pointsDrawn = frames;
  const gl = WebGL2RenderingContext.prototype;
  const { clear, drawArrays, drawElements } = gl;
  gl.clear = function (...words) { // once a frame, at its beginning
    frames.last = frames.now;
    frames.now = 0;
    clear.apply(this, words);
  };
  const add = (mode, count) => {
    if (mode === gl.POINTS) frames.now += count;
    frames.most = Math.max(frames.most, frames.now);
  };
  gl.drawArrays = function (mode, first, count) {
    add(mode, count);
    drawArrays.call(this, mode, first, count);
  };
  gl.drawElements = function (mode, count, type, offset) {
    add(mode, count);
    drawElements.call(this, mode, count, type, offset);
  };
});

/** Points that WebGL was given for the frame on show, and at most for any frame since the page was loaded. */
export const pointsDrawn = (page) =>
  page.evaluate(() => ({ now: globalThis.pointsDrawn.now, most: globalThis.pointsDrawn.most }));

export const canvasOf = (page) => page.locator('#map-canvas');

/** Waits until the view has all that it asked for; of one epoch if given. */
export async function settled(page, epoch) {
  await page.locator(`#map-canvas[data-state=ready][data-pending=no]${epoch === undefined ? '' : `[data-epoch="${epoch}"]`}`)
    .waitFor({ timeout: 120_000 });
}

/** The part of the canvas that nothing lies over; x and y say where it begins in the canvas. */
export async function pictureOf(page) {
  const box = await canvasOf(page).boundingBox();
  const narrow = box.width < 600;
  const [left, right, top, bottom] = narrow ? [8, 64, 8, 110] : [300, 80, 8, 130];
  const clip = { x: box.x + left, y: box.y + top, width: box.width - left - right, height: box.height - top - bottom };
  const picture = PNG.sync.read(await page.screenshot({ clip, scale: 'css' }));
  return Object.assign(picture, { x: left, y: top });
}

/** Clicks (or taps) on the map where it shows something: at the `share` of all such places, [0, 1). */
export async function pointAt(page, share, background, tap = false) {
  const picture = await pictureOf(page);
  const spots = [];
  const shows = (x, y) => {
    const at = 4 * (y * picture.width + x);
    return !background(picture.data[at], picture.data[at + 1], picture.data[at + 2]);
  };
  for (let y = 4; y < picture.height - 4; y += 5) {
    for (let x = 4; x < picture.width - 4; x += 5) {
      if ([[-2, 0], [2, 0], [0, -2], [0, 2], [0, 0]].every(([dx, dy]) => shows(x + dx, y + dy))) spots.push([x, y]);
    }
  }
  if (spots.length < 10) throw new Error('the picture shows next to nothing to point at');
  // The first from there on over which no message lies.
  const box = await canvasOf(page).boundingBox();
  const inPage = spots.slice(Math.floor(share * spots.length)).map(([x, y]) => [x + picture.x, y + picture.y]);
  const free = await page.evaluate(([places, left, top]) =>
    places.findIndex(([x, y]) => document.elementFromPoint(x + left, y + top)?.id === 'map-canvas'), [inPage, box.x, box.y]);
  if (free < 0) throw new Error('something lies over all of the map');
  const position = { x: inPage[free][0], y: inPage[free][1] };
  if (tap) await canvasOf(page).tap({ position });
  else await canvasOf(page).click({ position });
}

/** How many pixels of a picture `holds` is true of; it gets red, green, blue in [0, 255]. */
export function countPixels(picture, holds) {
  let count = 0;
  for (let i = 0; i < picture.data.length; i += 4) {
    if (holds(picture.data[i], picture.data[i + 1], picture.data[i + 2])) ++count;
  }
  return count;
}

/** Pixels in which two pictures differ by more than `least` in some channel, and of which, in the first, `holds`. */
export function differing(a, b, least = 24, holds = () => true) {
  let count = 0;
  for (let i = 0; i < a.data.length; i += 4) {
    if ([0, 1, 2].some((k) => Math.abs(a.data[i + k] - b.data[i + k]) > least) &&
      holds(a.data[i], a.data[i + 1], a.data[i + 2])) ++count;
  }
  return count;
}

export const like = ([r, g, b], within = 40) => (x, y, z) =>
  Math.abs(x - r) < within && Math.abs(y - g) < within && Math.abs(z - b) < within;

/** Faults that axe-core calls serious or critical, as text. */
export async function seriousFaults(page) {
  await page.evaluate(axeSource);
  const { violations, passes } = await page.evaluate(() => globalThis.axe.run());
  if (passes.length === 0) throw new Error('axe-core looked at nothing');
  return violations
    .filter((v) => v.impact === 'serious' || v.impact === 'critical')
    .map((v) => `${v.id}: ${v.nodes.map((n) => n.html).join(' ')}`);
}
