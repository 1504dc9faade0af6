// The Node client against daemons of its own. SIGHTLINED: the program. SIGHTLINE_NODE_CLIENT: the folder of the built package.
import assert from "node:assert/strict";
import {execFile, spawn} from "node:child_process";
import {once} from "node:events";
import {existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync} from "node:fs";
import {tmpdir} from "node:os";
import {join} from "node:path";
import {after, test} from "node:test";
import {setTimeout as sleep} from "node:timers/promises";
import {promisify} from "node:util";

const {SIGHTLINED, SIGHTLINE_NODE_CLIENT: FOLDER} = process.env;
const {Camera, Failed, LiveCamera, Refused, capsule, instance, box, transforms, vector} = await import(`${FOLDER}/dist/index.js`);

const HERO = 1n, PILLAR = 3n;
const OPENING = {
  instances: [instance(HERO, capsule(0.3, 1.8), [0, 0.9, 0]), instance(PILLAR, box(1, 4, 1), [0, 2, 2])],
  targets: [{id: HERO}],
  camera: {position: vector([0, 1.6, 6])},
};
const running = new Set();
after(() => [...running].forEach((process) => process.kill("SIGKILL")));

class Daemon {
  address = "127.0.0.1:0";

  async start() {
    const folder = mkdtempSync(join(tmpdir(), "sightline-"));
    const ready = join(folder, "ready");
    this.process = spawn(SIGHTLINED, ["--sampler", "embree", "--log-level", "error", "--listen", this.address, "--ready-file", ready], {stdio: "inherit"});
    running.add(this.process);
    while (!existsSync(ready)) {
      assert.equal(this.process.exitCode, null, "the daemon did not start");
      await sleep(10);
    }
    this.address = readFileSync(ready, "utf8").split(/\s/)[0];
    rmSync(folder, {recursive: true});
    return this;
  }

  async stop(signal = "SIGTERM") {
    running.delete(this.process);
    this.process.kill(signal);
    if (this.process.exitCode === null && this.process.signalCode === null) await once(this.process, "exit");
  }
}

function start() {
  return new Daemon().start();
}

async function play(camera, first, n) {
  const replies = [];
  for (let frame = first; frame < first + n; frame++)
    replies.push(await camera.tick({timeS: frame / 60, transforms: transforms([[HERO, [Math.sin(frame / 60), 0.9, 0]]])}));
  return replies;
}

function apart(a, b) {
  return Math.hypot(...["x", "y", "z"].map((axis) => a.pose.position[axis] - b.pose.position[axis]));
}

test("the camera moves until it sees what a pillar hides", async () => {
  const daemon = await start();
  const camera = await Camera.open(daemon.address, OPENING);
  assert.equal(camera.opened.instanceCount, 2n);
  const replies = await play(camera, 0, 120);
  assert.deepEqual(replies.map((reply) => reply.sequence), replies.map((_, i) => BigInt(i + 1)));
  assert.equal(replies[0].targets[0].visibleShare, 0);
  assert.equal(replies.at(-1).targets[0].visibleShare, 1);
  await camera.close();
  await daemon.stop();
});

test("ticks that are sent together are answered in order", async () => {
  const daemon = await start();
  const camera = await Camera.open(daemon.address, OPENING);
  const replies = await Promise.all([0, 1, 2, 3].map((frame) => camera.tick({timeS: frame / 60})));
  assert.deepEqual(replies.map((reply) => reply.sequence), [1n, 2n, 3n, 4n]);
  await camera.close();
  await daemon.stop();
});

test("errors have types and name the field", async () => {
  const daemon = await start();
  const camera = await Camera.open(daemon.address, OPENING);
  await assert.rejects(camera.tick({transforms: transforms([[99n, [0, 0, 0]]])}), (error) =>
    error instanceof Refused && error.error.fieldViolations[0].field === "tick.transforms.ids[0]");
  assert.equal((await camera.tick({timeS: 0})).sequence, 2n);
  await assert.rejects(Camera.open(daemon.address, {...OPENING, targets: [{id: 99n}]}), (error) =>
    error instanceof Failed && error.violations[0].field === "open.targets[0].id" && error.message.startsWith("NOT_FOUND: "));
  await assert.rejects(Camera.open("127.0.0.1:1", OPENING), (error) => error instanceof Failed && error.message.startsWith("UNAVAILABLE: "));
  await camera.close();
  await daemon.stop();
});

test("a scene file that is missing is an error", async () => {
  const scene = "no/such.glb";
  await assert.rejects(Camera.open("127.0.0.1:1", OPENING, {scene}), {code: "ENOENT"});
  assert.throws(() => new LiveCamera("127.0.0.1:1", OPENING, {scene}), {code: "ENOENT"});
});

test("the session goes on in the daemon at the next address", async () => {
  const [first, second] = [await start(), await start()];
  const reasons = [];
  const camera = await Camera.open([first.address, second.address], OPENING, {onResync: (reason) => reasons.push(reason)});
  const before = (await play(camera, 0, 30)).at(-1);
  await first.stop();
  const after = await play(camera, 30, 30);
  assert.equal(after.at(-1).sequence, 60n);
  assert.ok(apart(before, after[0]) < 0.2, "the camera does not jump");
  assert.deepEqual(reasons, ["the server is stopping"]);
  assert.equal(camera.resyncs, 1);
  await camera.close();
  await second.stop();
});

test("a session waits for a daemon that is started again", async () => {
  const daemon = await start();
  const camera = await Camera.open(daemon.address, OPENING);
  await play(camera, 0, 10);
  await daemon.stop("SIGKILL");
  const [replies] = await Promise.all([play(camera, 10, 10), sleep(500).then(() => daemon.start())]);
  assert.equal(replies.at(-1).sequence, 20n);
  await camera.close();
  await daemon.stop();
});

test("a daemon that hangs is left, and a camera gives up in time", async () => {
  const [first, second] = [await start(), await start()];
  const camera = await Camera.open([first.address, second.address], OPENING, {replyTimeoutS: 2, giveUpAfterS: 0.1});
  first.process.kill("SIGSTOP");
  await assert.rejects(camera.tick({timeS: 0}), (error) => error instanceof Failed && /nothing for 2 s/.test(error.message));
  assert.equal((await camera.tick({timeS: 1})).sequence, 2n, "the next tick tries again");
  first.process.kill("SIGCONT");
  await camera.close();
  await first.stop();
  await second.stop();
});

test("the example is short and moves a camera", async () => {
  const text = readFileSync(`${FOLDER}/example.mjs`, "utf8");
  assert.ok(text.split("\n").length < 60);
  const daemon = await start();
  const {stdout} = await promisify(execFile)(process.execPath, [`${FOLDER}/example.mjs`, daemon.address]);
  const lines = stdout.trim().split("\n");
  assert.equal(lines.length, 300);
  assert.ok(lines.filter((line) => line.endsWith("100% 100%")).length > 150);
  await daemon.stop();
});

test("types are checked", async () => {
  const wrong = `${FOLDER}/src/wrong.ts`;
  writeFileSync(wrong, 'import {Camera} from "./index.js";\nCamera.open("here", {targets: [{id: 7}]});\n');  // a number where a bigint belongs
  const done = await promisify(execFile)(`${FOLDER}/node_modules/.bin/tsc`, ["--noEmit", "-p", FOLDER]).catch((error) => error);
  rmSync(wrong);
  assert.match(done.stdout, /wrong\.ts\(2,.*'number' is not assignable to type 'bigint/);
});
