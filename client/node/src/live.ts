// A camera for a game loop: no call waits for long, with or without a daemon.
import {clone, create, type MessageInitShape} from "@bufbuild/protobuf";

import {Camera, isLost, pauses, readScene, type Options} from "./camera.js";
import {Display, type Source} from "./display.js";
import {asRefusal, Failed, Refused} from "./errors.js";
import type {TickError} from "./gen/sightline/v1/errors_pb.js";
import {OpenSessionSchema, TickSchema, type CameraReply, type OpenSession, type SessionOpened, type Tick} from "./gen/sightline/v1/session_pb.js";
import type {Drawn} from "./following.js";
import type {Quaternion, Vector} from "./shapes.js";
import {checkTrust} from "./stream.js";
import {MOST_WAITING, WaitingTicks} from "./waiting.js";

const LONGEST_PAUSE_S = 0.25; // between attempts, so that a daemon that is back is found soon

// How a LiveCamera reaches its daemons, and how long it waits.
export interface LiveOptions extends Omit<Options, "giveUpAfterS"> {
  waitS?: number; // `tick` waits at most so long for its answer. Default: 0.1
  fallbackAfterS?: number; // without an answer for so long, the camera follows the targets by itself; more than the way to the daemon and back. Default: 0.3
  blendS?: number; // so long the way back takes, in game time. Default: 0.5
  replyTimeoutS?: number; // without an answer for so long, the stream is given up for a new one. Default: 2
  closeS?: number; // so long the last ticks may take. Default: 1
}

// The camera to draw now.
export interface LiveView {
  position: Vector;
  rotation: Quaternion;
  fieldOfView: number;
  cut: boolean; // it jumped; reset what smooths over frames
  ageS: number; // game time since the tick that the newest reply covers; 0: this one
  source: Source;
  sequence: bigint; // number of the newest tick; the first is 1
  reply?: CameraReply; // the newest one
  refusals: TickError[]; // of ticks, since the former view; `sequence` says which
  trouble?: Failed; // why no daemon answers
}

// A session that keeps targets in view, for a game loop that must not wait. It opens at once, and reaches the daemon in the background, for ever
// if need be. A daemon that can never accept the opening is an error, which `update` and `tick` throw. One that is away is not.
export class LiveCamera {
  private readonly options: Required<Pick<LiveOptions, "waitS" | "fallbackAfterS" | "blendS" | "replyTimeoutS" | "closeS">> & Options;
  private readonly opening: OpenSession;
  private readonly display: Display;
  private readonly waiting = new WaitingTicks();
  private camera?: Camera;
  private sequence = 0n; // of the newest tick
  private answered = 0n; // the newest one that was answered
  private firstS?: number;
  private silentSince = 0; // counts while ticks are unanswered
  private refusals: TickError[] = [];
  private fatal?: unknown;
  private trouble?: Failed;
  private stopping = false;
  private readonly wakes = new Set<() => void>();
  private readonly worker: Promise<void>;

  // addresses: "host:port" or "unix:/path", one or several, which are tried in turn. Throws TypeError for an option that cannot be right, and
  // the error of reading the scene's file.
  constructor(private readonly addresses: string | string[], opening: MessageInitShape<typeof OpenSessionSchema>, options: LiveOptions = {}) {
    for (const address of [addresses].flat()) checkTrust(address, options);
    this.options = {waitS: 0.1, fallbackAfterS: 0.3, blendS: 0.5, replyTimeoutS: 2, closeS: 1, ...options, scene: readScene(options.scene), giveUpAfterS: 0};
    this.opening = clone(OpenSessionSchema, create(OpenSessionSchema, opening));
    this.display = new Display(this.opening, this.options.blendS);
    this.worker = this.work().catch((error) => {
      this.fatal = error;
      this.wake();
    });
  }

  // The answer of the daemon that opened the session last.
  get opened(): SessionOpened | undefined {
    return this.camera?.opened;
  }

  // As those of Camera.
  get resyncs(): number {
    return this.camera?.resyncs ?? 0;
  }

  get resumes(): number {
    return this.camera?.resumes ?? 0;
  }

  // Tells the daemon what has changed, and returns the camera to draw at once. The camera numbers ticks. Replies come in between calls, while
  // the program awaits something. Throws QueueFull, and Failed for an opening that no daemon accepts.
  update(message: MessageInitShape<typeof TickSchema>): LiveView {
    const tick = this.take(message);
    return this.viewOf(tick, this.sequence);
  }

  // The same, but waits for the answer at most waitS, and not at all while an earlier tick is unanswered.
  async tick(message: MessageInitShape<typeof TickSchema>): Promise<LiveView> {
    const idle = this.answered === this.sequence;
    const tick = this.take(message);
    if (!idle) return this.viewOf(tick, this.sequence);
    const due = performance.now() + this.options.waitS * 1000;
    while (this.answered < this.sequence && this.fatal === undefined && performance.now() < due) await this.change(due - performance.now());
    this.check();
    return this.viewOf(tick, this.sequence + 1n);
  }

  // The camera to draw between ticks, at a game time near the newest tick's. drawn: positions of targets at that time, by id.
  sample(timeS: number, drawn: Drawn = new Map()): LiveView {
    this.check();
    return this.view(timeS, this.sequence + 1n, drawn);
  }

  // Ends the session. Ticks that wait are sent before, if a daemon takes them within closeS. Never throws.
  async close(): Promise<void> {
    this.stopping = true;
    this.wake();
    let timer;
    await Promise.race([this.worker, new Promise((resolve) => (timer = setTimeout(resolve, this.options.closeS * 1000)))]);
    clearTimeout(timer);
    this.camera?.cutOff();
  }

  private check(): void {
    if (this.fatal !== undefined) throw this.fatal;
    if (this.stopping) throw new TypeError("the camera is closed");
  }

  private take(message: MessageInitShape<typeof TickSchema>): Tick {
    this.check();
    const tick = clone(TickSchema, create(TickSchema, message));
    if (tick.stepControl?.mergeIntoNext) throw new TypeError("stepControl.mergeIntoNext: a camera waits for a reply to each tick");
    if (tick.sequence) throw new TypeError("sequence: a LiveCamera numbers its ticks");
    if (!Number.isFinite(tick.timeS)) throw new TypeError("timeS: must be finite");
    tick.sequence = this.sequence + 1n;
    this.waiting.add(tick);
    this.display.takeTick(tick);
    if (this.answered === this.sequence) this.silentSince = performance.now();
    this.sequence = tick.sequence;
    this.firstS ??= tick.timeS;
    this.wake();
    return tick;
  }

  private viewOf(tick: Tick, countsFrom: bigint): LiveView {
    const view = this.view(tick.timeS, countsFrom);
    if (this.display.follows) this.waiting.suggest(this.display.observed());
    return view;
  }

  private view(timeS: number, countsFrom: bigint, drawn?: Drawn): LiveView {
    const silent = performance.now() - this.silentSince >= this.options.fallbackAfterS * 1000;
    if (this.answered !== this.sequence && silent) this.display.follow(countsFrom);
    let [shown, source] = this.display.show(timeS, drawn);
    const reply = this.display.newest;
    if (source === "predicted" && reply?.sequence === this.sequence) source = "reply";
    const {refusals, sequence, trouble} = this;
    this.refusals = [];
    return {...shown, ageS: Math.max(timeS - (reply?.timeS ?? this.firstS ?? timeS), 0), source, sequence, reply, refusals, trouble};
  }

  private wake(): void {
    for (const wake of this.wakes) wake();
  }

  // Waits until something changed.
  private async change(mostMs?: number): Promise<void> {
    await new Promise<void>((resolve) => {
      const timer = mostMs === undefined ? undefined : setTimeout(() => done(), mostMs);
      const done = () => {
        clearTimeout(timer);
        this.wakes.delete(done);
        resolve();
      };
      this.wakes.add(done);
    });
  }

  private async work(): Promise<void> {
    if (!(await this.tryForEver())) return;
    while (this.waiting.size || !this.stopping) {
      if (!this.waiting.size) await this.change();
      for (const tick of this.waiting.take()) if (!(await this.tryForEver(tick))) return;
    }
    await this.camera!.close().catch(() => undefined); // the session is over in any case
  }

  // Opens the session if need be, and gets the answer to the tick. False: the camera was closed.
  private async tryForEver(tick?: Tick): Promise<boolean> {
    for (const pauseS of pauses()) {
      if (pauseS > 0 && !this.stopping) await this.pause(Math.min(pauseS, LONGEST_PAUSE_S));
      if (pauseS > 0 && this.stopping) return false;
      const stream = this.streamName;
      try {
        this.camera ??= await Camera.open(this.addresses, this.opening, this.options);
        if (tick) this.answer(tick, await this.camera.tick(tick));
        return true;
      } catch (error) {
        if (tick && error instanceof Refused) {
          this.answer(tick, undefined, error.error);
          return true;
        }
        if (!(error instanceof Failed) || (!this.camera && !isLost(error, true))) throw error;
        if (tick && this.streamName !== stream && !isLost(error, false)) {
          this.answer(tick, undefined, asRefusal(error, tick.sequence)); // it would end the call of the next stream too
          return true;
        }
        this.trouble = error;
      }
    }
    return false;
  }

  // Another one after each opening and each resumption. A session that cannot be resumed goes on under another id.
  private get streamName(): string {
    return `${this.opened?.sessionId} ${this.resumes}`;
  }

  private async pause(seconds: number): Promise<void> {
    const due = performance.now() + seconds * 1000;
    while (!this.stopping && performance.now() < due) await this.change(due - performance.now());
  }

  private answer(tick: Tick, reply?: CameraReply, refusal?: TickError): void {
    this.answered = tick.sequence;
    this.trouble = undefined;
    this.silentSince = performance.now();
    if (reply) this.display.takeReply(reply);
    if (refusal && this.refusals.length < MOST_WAITING) this.refusals.push(refusal);
    this.wake();
  }
}
