// The camera that the player sees: the replies as sampled, a camera that follows the targets while none come, and the way back. No clock and no network:
// timeS is the game's, and the caller says whether the daemon is silent.
import {clone, create} from "@bufbuild/protobuf";

import {Follower, RecentMotion, TargetPlaces, type Drawn} from "./following.js";
import {Pose3Schema} from "./gen/sightline/v1/camera_pb.js";
import {CameraReplySchema, ObservedCameraSchema, type CameraReply, type ObservedCamera, type OpenSession, type Tick} from "./gen/sightline/v1/session_pb.js";
import {ORIGIN, inverse, length, minus, plus, product, read, readRotation, rotationOf, times, turnOf} from "./rotations.js";
import {PoseSampler, type Sample} from "./sampler.js";
import {vector, type Vector} from "./shapes.js";

// The origin of a shown pose.
// reply: the daemon's answer to this tick. predicted: an earlier answer, brought up to date. fallback: no daemon answers, and the camera keeps its
// place relative to the targets. blend: the way from the fallback to the daemon's camera.
export type Source = "reply" | "predicted" | "fallback" | "blend";

const NOTHING_DRAWN: Drawn = new Map();

// The fallback's pose minus the daemon's, where they met.
interface Blend {
  sinceS: number;
  shift: Vector;
  turn: Vector;
  zoom: number;
}

export class Display {
  readonly places: TargetPlaces;
  newest?: CameraReply;
  private sampler = new PoseSampler(); // of the replies that count: while there is a follower, those that end the fallback
  private shown: Sample;
  private shownS = 0;
  private centre?: Vector; // of the targets when that was shown
  private offsets: [timeS: number, offset: Vector][] = []; // the camera minus the centre at the last two times
  private follower?: Follower;
  private hasFollowed = false; // since the follower began, it was shown
  private countsFrom = 0n; // replies to ticks from this number on end the fallback
  private blend?: Blend;
  private shifts: [sequence: bigint, by: Vector][] = []; // of the world, by ticks that no reply covers so far
  private readonly motion = new RecentMotion();

  constructor(opening: OpenSession, private readonly blendS: number) {
    this.places = new TargetPlaces(opening);
    const {position, rotation} = opening.camera ?? {};
    this.shown = {position: read(position), rotation: readRotation(rotation), fieldOfView: opening.lens?.fieldOfView ?? 0, cut: false};
    this.centre = this.places.centre(NOTHING_DRAWN);
    this.follower = new Follower(this.offset(), ORIGIN, 0); // there is no reply so far, so the camera follows from the start
  }

  get follows(): boolean {
    return this.follower !== undefined;
  }

  takeTick(tick: Tick): void {
    if (tick.worldShift) this.shiftWorld(tick.sequence, read(tick.worldShift));
    const before = this.places.counted();
    this.places.apply(tick);
    const after = this.places.counted();
    if (before.length === after.length && before.every(([id, weight], i) => id === after[i]![0] && weight === after[i]![1])) return;
    // The centre may jump, and the camera must not.
    this.centre = this.places.centre(NOTHING_DRAWN);
    this.offsets = [];
    if (this.follower && this.centre) this.follower = new Follower(minus(this.shown.position, this.centre), ORIGIN, tick.timeS);
  }

  takeReply(reply: CameraReply): void {
    this.newest = reply;
    if (!this.follower || reply.sequence >= this.countsFrom) this.sampler.add(this.inThisWorld(reply));
  }

  // The daemon is silent. countsFrom: the first tick whose reply ends the fallback.
  follow(countsFrom: bigint): void {
    if (!this.follower) {
      this.follower = new Follower(this.offset(), this.relativeVelocity(), this.shownS);
      this.hasFollowed = false;
    } else if (this.countsFrom > 0n) {
      return;
    }
    this.countsFrom = countsFrom;
    this.sampler = new PoseSampler();
    this.blend = undefined;
  }

  // The camera at a game time. drawn: positions of targets at that time, if they are newer than the newest tick.
  show(timeS: number, drawn: Drawn = NOTHING_DRAWN): [Sample, Source] {
    const centre = this.places.centre(drawn);
    const followed = this.followed(timeS, centre);
    const daemon = this.sampler.sample(timeS, this.places.position(this.sampler.targetId, drawn));
    if (daemon && followed) this.goBack(followed, daemon, timeS);
    if (!daemon) this.hasFollowed = true; // there is a follower until there is a reply
    const shown: [Sample, Source] = daemon ? this.blended(daemon, timeS) : [followed!, "fallback"];
    this.remember(shown[0], timeS, centre);
    return shown;
  }

  // The camera that the player sees, so that the daemon goes on from it.
  observed(): ObservedCamera {
    const {position, rotation: [x, y, z, w]} = this.shown;
    return create(ObservedCameraSchema, {pose: {position: vector(position), rotation: {x, y, z, w}}, velocity: vector(this.motion.velocity())});
  }

  private shiftWorld(sequence: bigint, by: Vector): void {
    this.shifts.push([sequence, by]);
    this.shown = {...this.shown, position: plus(this.shown.position, by)};
    this.centre = this.centre && plus(this.centre, by);
    for (const part of [this.places, this.sampler, this.motion]) part.shift(by);
  }

  // The reply where the world has been shifted since its tick.
  private inThisWorld(reply: CameraReply): CameraReply {
    this.shifts = this.shifts.filter(([sequence]) => sequence > reply.sequence);
    if (!this.shifts.length) return reply;
    const moved = clone(CameraReplySchema, reply);
    const position = this.shifts.reduce((at, [, by]) => plus(at, by), read(reply.pose?.position));
    moved.pose = create(Pose3Schema, {position: vector(position), rotation: reply.pose?.rotation});
    return moved;
  }

  private offset(): Vector {
    return this.centre ? minus(this.shown.position, this.centre) : ORIGIN;
  }

  // No faster than the camera of the newest reply: targets that are put elsewhere do not throw it.
  private relativeVelocity(): Vector {
    const [start, end] = this.offsets;
    if (!start || !end || !this.newest) return ORIGIN;
    const velocity = times(1 / (end[0] - start[0]), minus(end[1], start[1]));
    const most = length(read(this.newest.velocity)), speed = length(velocity);
    return speed <= most ? velocity : times(most / speed, velocity);
  }

  private followed(timeS: number, centre: Vector | undefined): Sample | undefined {
    return this.follower && {...this.shown, position: centre ? this.follower.at(timeS, centre) : this.shown.position, cut: false};
  }

  private goBack(followed: Sample, daemon: Sample, timeS: number): void {
    this.follower = undefined;
    if (!this.hasFollowed) return;
    this.blend = {
      sinceS: timeS, shift: minus(followed.position, daemon.position), turn: turnOf(product(followed.rotation, inverse(daemon.rotation))),
      zoom: followed.fieldOfView - daemon.fieldOfView,
    };
  }

  private blended(daemon: Sample, timeS: number): [Sample, Source] {
    const {blend} = this;
    const left = blend && !daemon.cut ? shareLeft(timeS - blend.sinceS, this.blendS) : 0;
    if (!blend || left === 0) {
      this.blend = undefined;
      return [daemon, "predicted"];
    }
    const position = plus(daemon.position, times(left, blend.shift));
    return [{position, rotation: product(rotationOf(times(left, blend.turn)), daemon.rotation), fieldOfView: daemon.fieldOfView + left * blend.zoom, cut: false}, "blend"];
  }

  private remember(sample: Sample, timeS: number, centre: Vector | undefined): void {
    this.shown = sample;
    this.shownS = timeS;
    this.centre = centre;
    this.motion.add(timeS, sample.position);
    if (!centre || sample.cut) this.offsets = [];
    const last = this.offsets.at(-1);
    if (centre && (!last || timeS > last[0])) this.offsets = [...this.offsets.slice(-1), [timeS, minus(sample.position, centre)]];
  }
}

function shareLeft(passedS: number, blendS: number): number {
  const x = blendS > 0 ? Math.min(Math.max(passedS / blendS, 0), 1) : 1;
  return 1 - x * x * (3 - 2 * x);
}
