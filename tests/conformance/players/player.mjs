// Plays conformance sessions with the Node client: player.mjs CLIENT_FOLDER. README.md describes the protocol.
import {readFile} from "node:fs/promises";
import {createRequire} from "node:module";
import {resolve} from "node:path";
import {createInterface} from "node:readline";
import {pathToFileURL} from "node:url";

const folder = resolve(process.argv[2]);
const from = createRequire(`${folder}/package.json`);
const sightline = await import(pathToFileURL(`${folder}/dist/index.js`));
const {fromJson, toJson} = await import(pathToFileURL(from.resolve("@bufbuild/protobuf").replace("/cjs/", "/esm/")));
const {status} = await import(pathToFileURL(from.resolve("@grpc/grpc-js")));

let camera, sampler, live;

async function trustOf({token, ...files}) {
  const pem = Object.fromEntries(await Promise.all(Object.entries(files).map(async ([name, path]) => [name, await readFile(path)])));
  return {token, tls: Object.keys(pem).length ? pem : undefined};
}

async function run({open, tick, address, uploads, scene, scene_file, trust = {}}) {
  if (open) {
    const files = await Promise.all(uploads.map((path) => readFile(path)));
    const options = {uploads: files, scene: scene_file ?? (scene && await readFile(scene)), ...await trustOf(trust)};
    camera = await sightline.Camera.open(address, fromJson(sightline.OpenSessionSchema, open), options);
    return {opened: toJson(sightline.SessionOpenedSchema, camera.opened)};
  }
  if (tick) return {camera: toJson(sightline.CameraReplySchema, await camera.tick(fromJson(sightline.TickSchema, tick)))};
  await camera.close();
  return {closed: {resyncs: camera.resyncs, resumes: camera.resumes}};
}

// The commands of tests/live.
const others = {
  sampler_new: () => ({sampler: (sampler = new sightline.PoseSampler()) && {}}),
  sampler_add: (reply) => ({taken: sampler.add(fromJson(sightline.CameraReplySchema, reply))}),
  sampler_shift: (by) => ({sampler: sampler.shift(by) ?? {}}),
  sampler_at({time_s, target}) {
    const shown = sampler.sample(time_s, target.length ? target : undefined);
    return {sample: shown ? [...shown.position, ...shown.rotation, shown.fieldOfView, Number(shown.cut)] : null};
  },
  live_open(opening, {address, wait_s, scene_file}) {
    live = new sightline.LiveCamera(address, fromJson(sightline.OpenSessionSchema, opening), {waitS: wait_s, scene: scene_file});
    return {live: {}};
  },
  async live_tick(message) {
    const tick = fromJson(sightline.TickSchema, message), began = performance.now();
    try {
      return {view: viewOf(await live.tick(tick), performance.now() - began)};
    } catch (error) {
      if (error instanceof sightline.Failed) return {error: status[error.code]};
      if (error instanceof sightline.QueueFull) return {error: "QUEUE_FULL"};
      throw error;
    }
  },
  async live_close() {
    const began = performance.now();
    await live.close();
    return {live_closed: {took_s: (performance.now() - began) / 1000, resyncs: live.resyncs, resumes: live.resumes}};
  },
};

function viewOf({position, rotation, fieldOfView, cut, ageS, source, sequence, reply, refusals, trouble}, tookMs) {
  return {
    position, rotation, field_of_view: fieldOfView, cut, age_s: ageS, source, sequence: Number(sequence), reply: Number(reply?.sequence ?? 0),
    hash: String(reply?.mirrorHash ?? 0), refusals: refusals.map((refusal) => Number(refusal.sequence)), refusal_codes: refusals.map((refusal) => refusal.code),
    trouble: trouble !== undefined, took_s: tookMs / 1000,
  };
}

for await (const line of createInterface({input: process.stdin})) {
  let answer;
  try {
    const command = JSON.parse(line), [name] = Object.keys(command);
    answer = await (others[name]?.(command[name], command) ?? run(command));
  } catch (error) {
    if (error instanceof sightline.Refused) answer = {refused: toJson(sightline.TickErrorSchema, error.error)};
    else if (error instanceof sightline.Failed) answer = {failed: {code: status[error.code], violations: error.violations}};
    else if (error instanceof TypeError) answer = {failed: {code: "INVALID_ARGUMENT", violations: []}}; // an option of the camera
    else throw error;
  }
  console.log(JSON.stringify(answer));
}
