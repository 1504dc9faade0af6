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

let camera;

async function trustOf({token, ...files}) {
  const pem = Object.fromEntries(await Promise.all(Object.entries(files).map(async ([name, path]) => [name, await readFile(path)])));
  return {token, tls: Object.keys(pem).length ? pem : undefined};
}

async function run({open, tick, address, uploads, trust = {}}) {
  if (open) {
    const files = await Promise.all(uploads.map((path) => readFile(path)));
    camera = await sightline.Camera.open(address, fromJson(sightline.OpenSessionSchema, open), {uploads: files, ...await trustOf(trust)});
    return {opened: toJson(sightline.SessionOpenedSchema, camera.opened)};
  }
  if (tick) return {camera: toJson(sightline.CameraReplySchema, await camera.tick(fromJson(sightline.TickSchema, tick)))};
  await camera.close();
  return {closed: {resyncs: camera.resyncs, resumes: camera.resumes}};
}

for await (const line of createInterface({input: process.stdin})) {
  let answer;
  try {
    answer = await run(JSON.parse(line));
  } catch (error) {
    if (error instanceof sightline.Refused) answer = {refused: toJson(sightline.TickErrorSchema, error.error)};
    else if (error instanceof sightline.Failed) answer = {failed: {code: status[error.code], violations: error.violations}};
    else if (error instanceof TypeError) answer = {failed: {code: "INVALID_ARGUMENT", violations: []}}; // an option of the camera
    else throw error;
  }
  console.log(JSON.stringify(answer));
}
