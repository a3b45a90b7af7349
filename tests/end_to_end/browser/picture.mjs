// picture.mjs URL OUT.jpg: the viewer on the map that URL opens, with trajectories, as in the project's README.

import path from 'node:path';
import { newPage, openBrowser, settled } from './browser.mjs';

const [url, out] = process.argv.slice(2);
if (!url || !out) {
  console.error('usage: picture.mjs URL OUT.jpg');
  process.exit(2);
}
const browser = await openBrowser();
const page = await newPage(browser, { viewport: { width: 1400, height: 820 } });
await page.goto(url);
await settled(page);
await page.getByRole('button', { name: 'Show all' }).click();
for (let i = 0; i < 3; ++i) await page.keyboard.press('+');
// About two million points: drawing may take its time here.
await page.getByRole('slider', { name: 'Detail' }).fill('73');
await settled(page);
await page.screenshot({ path: path.resolve(out), type: 'jpeg', quality: 84 });
await browser.close();
