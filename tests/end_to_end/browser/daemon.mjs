// Runs the built programs the way a user does: a real daemon on free ports, the real command line.

import { execFile, spawn } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { promisify } from 'node:util';

const bin = process.env.MAPKEEP_BIN;
const patience = 600_000;
const run = promisify(execFile);

export const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Waits until `done` gives something; says what it waited for if that does not come. */
export async function until(done, what, limit = 120_000) {
  const end = Date.now() + limit;
  for (;;) {
    const result = await done();
    if (result) return result;
    if (Date.now() > end) throw new Error(`waited ${limit / 1000} s for ${what}`);
    await pause(50);
  }
}

export const scratch = () => fs.mkdtempSync(path.join(os.tmpdir(), 'mapkeep-browser-'));

/** Sessions of one simulated street whose poses are the true ones, so that each fits the others. */
export async function simulate(out, { sessions = 1, scans = 30, sensor = 'vlp16', seed = 1, more = [] }) {
  const words = ['simulate', out, '--sessions', sessions, '--scans', scans, '--sensor', sensor, '--seed', seed, ...more];
  await run(path.join(bin, 'mapkeep'), words.map(String), { timeout: patience });
  const directories = fs.readdirSync(out).filter((name) => name.startsWith('session-')).sort();
  return directories.map((name) => {
    const directory = path.join(out, name);
    fs.copyFileSync(path.join(directory, 'truth_poses.txt'), path.join(directory, 'poses.txt'));
    return directory;
  });
}

export class Daemon {
  constructor(directory, flags = []) {
    this.directory = directory;
    this.flags = flags;
  }

  async start() {
    const ports = path.join(this.directory, 'ports.json');
    fs.rmSync(ports, { force: true });
    const log = fs.openSync(path.join(this.directory, 'log'), 'a');
    this.process = spawn(
      path.join(bin, 'mapkeepd'),
      ['--data', path.join(this.directory, 'data'), '--listen', '127.0.0.1:0', '--admin', '127.0.0.1:0', '--http',
        '127.0.0.1:0', '--ports-file', ports, ...this.flags],
      { stdio: ['ignore', log, log] },
    );
    fs.closeSync(log);
    await until(() => fs.existsSync(ports) || this.process.exitCode !== null, 'the daemon to serve', 60_000);
    if (this.process.exitCode !== null) {
      throw new Error(`the daemon did not start:\n${fs.readFileSync(path.join(this.directory, 'log'), 'utf8')}`);
    }
    const picked = JSON.parse(fs.readFileSync(ports, 'utf8'));
    this.server = picked.listen;
    this.url = `http://${picked.http}`;
  }

  async stop() {
    if (this.process.exitCode !== null) return;
    const ended = new Promise((resolve) => this.process.once('exit', resolve));
    this.process.kill('SIGTERM');
    await ended;
  }

  /** What the command prints; an error with its output if it fails and `fails` is not set. */
  async cli(words, { fails = false } = {}) {
    try {
      const all = ['--server', this.server, ...(this.token ? ['--token-file', this.token] : []), ...words.map(String)];
      const { stdout } = await run(path.join(bin, 'mapkeep'), all, { timeout: patience });
      if (fails) throw new Error(`mapkeep ${words.join(' ')} was expected to fail`);
      return stdout;
    } catch (error) {
      if (fails && error.code) return `${error.stdout}${error.stderr}`;
      throw error;
    }
  }

  async json(words) {
    return JSON.parse(await this.cli(['--json', ...words]));
  }
}
