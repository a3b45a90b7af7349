// The viewer before a daemon that asks for tokens.

import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import path from 'node:path';
import { after, before, test } from 'node:test';
import { newPage, openBrowser, seriousFaults, settled } from './browser.mjs';
import { Daemon, scratch, simulate } from './daemon.mjs';

const directory = scratch();
const tokens = path.join(directory, 'tokens');
const newToken = (name, role, map) =>
  execFileSync(path.join(process.env.MAPKEEP_BIN, 'mapkeepd'),
    ['token', name, '--role', role, '--map', map, '--append', tokens], { encoding: 'utf8' }).trim();

let daemon;
let browser;
let reader;
let stranger;

before(async () => {
  const operator = newToken('chief', 'operator,robot', '*');
  reader = newToken('guest', 'reader', 'yard');
  stranger = newToken('neighbour', 'reader', 'elsewhere');
  daemon = new Daemon(directory, ['--tokens', tokens]);
  daemon.token = path.join(directory, 'operator-token');
  fs.writeFileSync(daemon.token, operator);
  await daemon.start();
  const [day] = await simulate(path.join(directory, 'street'), { scans: 12 });
  await daemon.cli(['map', 'create', 'yard']);
  await daemon.cli(['session', 'upload', 'yard', day, '--id', 'day-1', '--wait']);
  browser = await openBrowser();
});

after(async () => {
  await browser?.close();
  await daemon?.stop();
  fs.rmSync(directory, { recursive: true, force: true });
});

async function signIn(page, token) {
  await page.getByLabel('Token').fill(token);
  await page.getByRole('button', { name: 'Open' }).click();
}

test('a token is asked for, a wrong one is refused, a right one shows map, tiles and events', async () => {
  const page = await newPage(browser);
  await page.goto(`${daemon.url}/#/yard/map`);
  await page.getByRole('dialog', { name: 'Sign in' }).waitFor();
  assert.deepEqual(await seriousFaults(page), []);
  await signIn(page, 'nobody-made-this');
  await page.getByText('does not accept this token').waitFor();
  await signIn(page, reader);
  await settled(page, 1);
  await page.locator('.live.live').waitFor();
  await page.reload();
  await settled(page, 1);
  assert.ok(!page.url().includes(reader), 'the token is not in the address');
  await page.context().close();
});

test('who may not read a map is told so', async () => {
  const page = await newPage(browser);
  await page.goto(`${daemon.url}/#/yard/map`);
  await page.getByRole('dialog', { name: 'Sign in' }).waitFor();
  await signIn(page, stranger);
  await page.getByRole('heading', { name: 'The map cannot be shown' }).waitFor();
  await page.context().close();
});
