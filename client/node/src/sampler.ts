// The camera at the time of drawing, from replies that come less often and late.
import type {CameraReply} from "./gen/sightline/v1/session_pb.js";
import {ORIGIN, inverse, minus, plus, product, read, readRotation, rotationOf, times, turnOf} from "./rotations.js";
import type {Quaternion, Vector} from "./shapes.js";

const FULL_S = 0.15; // a reply's velocities carry the camera on in full for so long
const STOP_S = 0.35; // until then they ease out
const FADE_S = 0.02; // what a new reply changes fades in with this time constant

// A camera that can be drawn. cut: it jumped since the former sample; reset what smooths over frames.
export interface Sample {
  position: Vector;
  rotation: Quaternion;
  fieldOfView: number;
  cut: boolean;
}

// For how long a reply's velocities have carried the camera at this age: at most 0.25 s.
function carriedS(ageS: number): number {
  if (ageS <= FULL_S) return Math.max(ageS, -FULL_S);
  const easingS = Math.min(ageS, STOP_S) - FULL_S;
  return FULL_S + easingS - (easingS * easingS) / (2 * (STOP_S - FULL_S));
}

// The part of a reply that the sampler needs.
class Newest {
  readonly targetId: bigint;
  private readonly timeS: number;
  private pose: Sample;
  private readonly velocity: Vector;
  private readonly angularVelocity: Vector;
  private target?: Vector; // where the target was

  constructor(reply: CameraReply) {
    this.timeS = reply.poseTimeS;
    this.pose = {position: read(reply.pose?.position), rotation: readRotation(reply.pose?.rotation), fieldOfView: reply.fieldOfView, cut: false};
    this.velocity = read(reply.velocity);
    this.angularVelocity = read(reply.angularVelocity);
    this.targetId = reply.relativePose?.targetId ?? 0n;
    if (this.targetId && reply.relativePose?.unrotatedPose) this.target = minus(this.pose.position, read(reply.relativePose.unrotatedPose.position));
  }

  shift(by: Vector): void {
    this.pose = {...this.pose, position: plus(this.pose.position, by)};
    this.target = this.target && plus(this.target, by);
  }

  at(timeS: number, targetPosition?: Vector): Sample {
    const ageS = timeS - this.timeS, carried = carriedS(ageS);
    let position = plus(this.pose.position, times(carried, this.velocity));
    if (ageS > FULL_S && targetPosition && this.target) position = plus(position, times(1 - carried / ageS, minus(targetPosition, this.target)));
    return {...this.pose, position, rotation: product(rotationOf(times(carried, this.angularVelocity)), this.pose.rotation)};
  }
}

// Gives the camera at any time from the newest reply, for a renderer that is faster than the replies, or ahead of them. It only computes.
// client/SAMPLING.md states the rules.
//
//   sampler.add(reply);                                          // each reply, as it comes
//   const shown = sampler.sample(timeS, targetPosition);         // each frame: game time, and where sampler.targetId is drawn
export class PoseSampler {
  private sequence = -1n;
  private newest?: Newest;
  private former?: Newest; // the one of the former sample, while a newer one waits to be shown
  private cut = false; // a reply since the former sample was a cut
  private timeS = -Infinity; // of the former sample
  // The remainder that fades away: the former sample minus the newest reply, at timeS.
  private gap = ORIGIN;
  private turn = ORIGIN;
  private zoom = 0;

  // The target whose position `sample` takes; 0n: none.
  get targetId(): bigint {
    return this.newest?.targetId ?? 0n;
  }

  // Takes a reply. False: it is not newer than the newest one, and is ignored.
  add(reply: CameraReply): boolean {
    if (reply.sequence <= this.sequence) return false;
    if (!this.former && this.timeS > -Infinity) this.former = this.newest;
    this.sequence = reply.sequence;
    this.newest = new Newest(reply);
    this.cut ||= reply.cut;
    return true;
  }

  // The client's world has a new origin: the replies that were added lie elsewhere now (Tick.worldShift).
  shift(by: Vector): void {
    this.newest?.shift(by);
    this.former?.shift(by);
  }

  // The camera at a game time. targetPosition: where targetId is at that time; without it, only velocities carry the camera on. Undefined:
  // there is no reply so far.
  sample(timeS: number, targetPosition?: Vector): Sample | undefined {
    const {newest, former, cut} = this;
    if (!newest) return undefined;
    this.fade(timeS);
    const plain = newest.at(timeS, targetPosition);
    this.cut = false;
    this.former = undefined;
    if (cut) {
      this.gap = this.turn = ORIGIN;
      this.zoom = 0;
    } else if (former) {
      const before = former.at(timeS, former.targetId === newest.targetId ? targetPosition : undefined);
      this.gap = plus(this.gap, minus(before.position, plain.position));
      this.turn = turnOf(product(product(rotationOf(this.turn), before.rotation), inverse(plain.rotation)));
      this.zoom += before.fieldOfView - plain.fieldOfView;
    }
    return {position: plus(plain.position, this.gap), rotation: product(rotationOf(this.turn), plain.rotation), fieldOfView: plain.fieldOfView + this.zoom, cut};
  }

  private fade(timeS: number): void {
    const passedS = timeS - this.timeS;
    if (!(passedS > 0)) return;
    const left = Math.exp(-passedS / FADE_S);
    this.gap = times(left, this.gap);
    this.turn = times(left, this.turn);
    this.zoom *= left;
    this.timeS = timeS;
  }
}
