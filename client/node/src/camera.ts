// A camera that keeps its targets in view, tick by tick.
import {readFileSync} from "node:fs";

import {clone, create, type MessageInitShape} from "@bufbuild/protobuf";
import {status} from "@grpc/grpc-js";

import {Failed, Refused} from "./errors.js";
import type {ControlRequest, ControlResponse} from "./gen/sightline/v1/camera_control_pb.js";
import {
  OpenSessionSchema, ResumeSessionSchema, SessionOpenedSchema, TickSchema, type CameraReply, type SessionOpened, type Tick,
} from "./gen/sightline/v1/session_pb.js";
import {Snapshot, wasApplied} from "./snapshot.js";
import {Stream, type Trust} from "./stream.js";

const LONGEST_PAUSE_S = 1;
const LONGEST_RESUME_S = 2; // a daemon resumes a session at once, or not at all
const LOST = [status.UNAVAILABLE, status.CANCELLED, status.UNKNOWN, status.INTERNAL, status.DEADLINE_EXCEEDED, status.ABORTED];

// How a camera reaches its daemons and what it does when one is lost.
export interface Options extends Trust {
  giveUpAfterS?: number; // how long a tick waits for a daemon that takes the session over; 0: a lost session is an error at once. Default: 30
  replyTimeoutS?: number; // a daemon that answers nothing for so long is taken for lost. Default: 5
  openTimeoutS?: number; // the same for an upload, and for the opening, for which the daemon loads the scene. Default: 30
  scene?: Uint8Array | string | URL; // the client's own scene file (.glb, or .gltf without other files) or its path; each daemon gets it, and its hash goes into scene.hash
  uploads?: Uint8Array[]; // files that the opening or a tick names by their hashes; a daemon that does not have one gets it
  onResync?: (reason: string) => void; // called after the session was opened again
}

// A session. When the stream breaks, the next tick goes on with the session in a new stream: the daemon keeps it for a while (its flag
// --resume-grace-s), and the replies are those of an unbroken stream. When the daemon does not keep it, goes away, or says Drain, the next
// tick opens the session again, in the daemon that answers then, and returns its reply: at the camera's last pose, with the scene, targets,
// settings, limits and lens as they were.
export class Camera {
  // What the daemon said when it opened the session, the last time that one did.
  opened: SessionOpened = create(SessionOpenedSchema);
  // How many times the session was opened again, in another daemon or in the same one.
  resyncs = 0;
  // How many times it went on in another stream without that.
  resumes = 0;

  private readonly options: Required<Omit<Options, "scene" | "onResync" | keyof Trust>> & Options;
  private readonly scene?: Uint8Array; // the client's own
  private readonly snapshot: Snapshot;
  private stream?: Stream;
  private address = 0;
  private sequence = 0n;
  private token: SessionOpened["resumeToken"] = new Uint8Array(); // of the session in the daemon at `address`, also while it is lost; empty: it cannot be resumed
  private answered = 0n; // the newest tick of this session that was answered
  private running: Promise<unknown> = Promise.resolve();

  private constructor(private readonly addresses: string[], opening: MessageInitShape<typeof OpenSessionSchema>, options: Options) {
    this.options = {giveUpAfterS: 30, replyTimeoutS: 5, openTimeoutS: 30, uploads: [], ...options};
    this.scene = readScene(options.scene);
    this.snapshot = new Snapshot(clone(OpenSessionSchema, create(OpenSessionSchema, opening)));
  }

  // Opens a session. addresses: "host:port" or "unix:/path", one or several, which are tried in turn. Throws Failed, and
  // the error of reading the scene's file.
  static async open(addresses: string | string[], opening: MessageInitShape<typeof OpenSessionSchema>, options: Options = {}): Promise<Camera> {
    const camera = new Camera([addresses].flat(), opening, options);
    for (let left = camera.addresses.length; ; ) {
      try {
        await camera.openStream();
        return camera;
      } catch (error) {
        camera.leave();
        if (!isLost(error, true) || --left === 0) throw error;
      }
    }
  }

  // Sends what has changed, and returns where the camera goes. The camera numbers ticks whose sequence is 0 or absent. Ticks go one after the
  // other: one that is sent while another waits follows when that one is answered. No stepControl that merges a tick into the next one: it
  // would get no reply. Throws Refused or Failed.
  tick(message: MessageInitShape<typeof TickSchema>): Promise<CameraReply> {
    const answer = this.running.then(() => this.step(clone(TickSchema, create(TickSchema, message))));
    this.running = answer.catch(() => undefined);
    return answer;
  }

  // Ends the session. Throws Failed if it was lost meanwhile.
  async close(): Promise<void> {
    await this.running;
    const stream = this.stream;
    this.stream = undefined;
    await stream?.finish(this.options.replyTimeoutS);
  }

  // Ends the stream at once. For LiveCamera, whose daemon may not answer.
  cutOff(): void {
    this.stream?.cutOff();
  }

  private async step(tick: Tick): Promise<CameraReply> {
    if (tick.stepControl?.mergeIntoNext) throw new TypeError("stepControl.mergeIntoNext: a camera waits for a reply to each tick");
    if (tick.sequence === 0n) tick.sequence = this.sequence + 1n;
    if (tick.sequence > this.sequence) this.sequence = tick.sequence;
    const [response, reason] = await this.askUntilAnswered(tick);
    this.answered = tick.sequence;
    if (reason !== undefined) {
      this.resyncs += 1;
      this.options.onResync?.(reason);
    }
    const answer = response.message;
    if (answer.case === "tickError") {
      if (wasApplied(answer.value)) this.snapshot.apply(tick);
      throw new Refused(answer.value);
    }
    this.snapshot.apply(tick);
    this.snapshot.takeReply(answer.value as CameraReply);
    return answer.value as CameraReply;
  }

  // The answer, and the reason if the session had to be opened again.
  private async askUntilAnswered(tick: Tick): Promise<[ControlResponse, string | undefined]> {
    const giveUp = performance.now() + this.options.giveUpAfterS * 1000;
    let reason: string | undefined, reopened = false;
    for (const pauseS of pauses()) {
      if (pauseS > 0) await new Promise((resolve) => setTimeout(resolve, pauseS * 1000));
      let opening = false;
      try {
        if (this.stream?.drained !== undefined) {
          reason = this.stream.drained;
          this.leave();
        }
        opening = !this.stream;
        let taken = false;
        if (opening && this.token.length) taken = await this.resume(tick);
        if (!this.stream) {
          await this.openStream();
          reopened = true;
          this.tellPast(tick);
        }
        opening = false;
        const answer = await this.ask(tick, taken);
        return [answer, reopened ? (reason ?? "the former tick lost the session") : undefined];
      } catch (error) {
        this.leave();
        if (!isLost(error, opening) || performance.now() >= giveUp) throw error;
        reason ??= (error as Failed).message;
      }
    }
    throw new Error("unreachable");
  }

  private async openStream(): Promise<void> {
    const own = this.scene ? [this.scene] : [];
    try {
      await this.openSession(this.snapshot.sceneHash ? [] : own); // the opening needs the hash, which comes with the upload
    } catch (error) {
      const uploads = [...own, ...this.options.uploads];
      if (!lacksScene(error) || !uploads.length) throw error;
      this.stream?.cutOff();
      this.stream = undefined;
      await this.openSession(uploads);
    }
  }

  private async openSession(uploads: Uint8Array[]): Promise<void> {
    if (uploads.length) await this.upload(uploads);
    this.stream = new Stream(this.addresses[this.address]!, this.options);
    const value = this.snapshot.opening();
    value.resumable = true;
    this.opened = await firstAnswer(this.stream!, {case: "open", value}, this.options.openTimeoutS);
    this.token = this.opened.resumeToken;
    this.answered = 0n;
  }

  // In a stream that opens no session, since the daemon does not wait long for an opening.
  private async upload(scenes: Uint8Array[]): Promise<void> {
    const stream = new Stream(this.addresses[this.address]!, this.options);
    try {
      for (const scene of scenes) {
        const {hash} = await stream.upload(scene, this.options.openTimeoutS);
        if (scene === this.scene) this.snapshot.sceneHash = hash;
      }
    } finally {
      stream.cutOff();
    }
  }

  // Goes on with the lost session, if the daemon keeps it. True: the daemon has taken the tick already, and its answer follows. Without a
  // stream afterwards, a new session must be opened.
  private async resume(next: Tick): Promise<boolean> {
    const stream = new Stream(this.addresses[this.address]!, this.options);
    const value = create(ResumeSessionSchema, {token: this.token, answeredSequence: this.answered});
    try {
      const {newestSequence} = await firstAnswer(stream, {case: "resume", value}, Math.min(this.options.replyTimeoutS, LONGEST_RESUME_S));
      if (newestSequence === next.sequence || newestSequence === this.answered) {
        this.stream = stream;
        this.resumes += 1;
        return newestSequence === next.sequence;
      }
      await stream.finish(this.options.replyTimeoutS); // the session lacks ticks that a former stream lost
    } catch (error) {
      stream.cutOff();
      if (isLost(error, true) && this.addresses.length === 1) throw error;
      if (isLost(error, true)) this.nextAddress();
    }
    this.token = new Uint8Array();
    return false;
  }

  private tellPast(next: Tick): void {
    const ticks = this.snapshot.ticks(next.sequence);
    if (next.delta?.baseRevision !== undefined)
      next.delta.baseRevision = this.opened.mirrorRevision + BigInt(ticks.filter((tick) => tick.delta).length);
    for (const value of ticks) this.stream!.send({case: "tick", value});
  }

  private async ask(tick: Tick, taken: boolean): Promise<ControlResponse> {
    if (!taken) this.stream!.send({case: "tick", value: tick});
    for (;;) {
      const response = await this.stream!.receive(this.options.replyTimeoutS);
      const {message} = response;
      if (message.case === "tickError" || (message.case === "camera" && message.value.sequence === tick.sequence)) return response;
    }
  }

  // Gives the stream up. The next one goes to the next address, unless the session can be resumed.
  private leave(): void {
    if (this.stream?.drained !== undefined) this.token = new Uint8Array();
    this.stream?.cutOff();
    this.stream = undefined;
    if (!this.token.length) this.nextAddress();
  }

  private nextAddress(): void {
    this.address = (this.address + 1) % this.addresses.length;
  }
}

async function firstAnswer(stream: Stream, request: ControlRequest["message"], timeoutS: number): Promise<SessionOpened> {
  stream.send(request);
  for (;;) {
    const {message} = await stream.receive(timeoutS);
    if (message.case === "opened") return message.value;
  }
}

// True if another attempt, or another daemon, may help. A scene file that is too large stays so.
export function isLost(error: unknown, opening: boolean): boolean {
  if (!(error instanceof Failed)) return false;
  return LOST.includes(error.code) || (opening && error.code === status.RESOURCE_EXHAUSTED && !names(error, "chunk"));
}

function lacksScene(error: unknown): boolean {
  return error instanceof Failed && error.code === status.NOT_FOUND && names(error, "scene");
}

function names(error: Failed, part: string): boolean {
  return error.violations.some(({field}) => field.includes(part));
}

export function readScene(scene: Options["scene"]): Uint8Array | undefined {
  return typeof scene === "string" || scene instanceof URL ? readFileSync(scene) : scene;
}

// The times to wait between attempts, in seconds: none, then longer and longer. They are random, so that the cameras of a lost daemon do
// not all come at once.
export function* pauses(): Generator<number> {
  yield 0;
  for (let pauseS = 0.05; ; pauseS = Math.min(2 * pauseS, LONGEST_PAUSE_S)) yield pauseS * (0.5 + Math.random() / 2);
}
