// The state of a session as the client knows it, so that the session can go on in another daemon.
import {clone, create, mergeFromBinary, toBinary, type DescMessage, type MessageShape} from "@bufbuild/protobuf";

import {Pose3Schema, Vec3Schema, type Pose3, type Vec3} from "./gen/sightline/v1/camera_pb.js";
import {TickError_Code, type TickError} from "./gen/sightline/v1/errors_pb.js";
import {
  AttributeChangeSchema, SceneDeltaSchema, SceneRefSchema, TransformsSchema, type Attributes, type NewInstance, type SceneDelta, type Transforms,
} from "./gen/sightline/v1/scene_pb.js";
import {
  ObservedCameraSchema, OpenSessionSchema, StepControlSchema, TickSchema, type CameraReply, type ObservedCamera, type OpenSession, type Tick,
} from "./gen/sightline/v1/session_pb.js";
import {CameraLimitsSchema, Settings_Preset, SettingsSchema} from "./gen/sightline/v1/settings_pb.js";
import {Shot_PlaceSchema, ShotSchema, type Shot, type ShotReport} from "./gen/sightline/v1/shot_pb.js";
import {TuningSchema} from "./gen/sightline/tuning/v1alpha1/tuning_pb.js";

function shifted(place: Vec3 | undefined, shift: Vec3 | undefined, sign: number): Vec3 {
  return create(Vec3Schema, {
    x: (place?.x ?? 0) + sign * (shift?.x ?? 0), y: (place?.y ?? 0) + sign * (shift?.y ?? 0), z: (place?.z ?? 0) + sign * (shift?.z ?? 0),
  });
}

function shiftedPose(pose: Pose3 | undefined, shift: Vec3 | undefined, sign: number): Pose3 {
  return create(Pose3Schema, {position: shifted(pose?.position, shift, sign), rotation: pose?.rotation});
}

// The changes that ticks made to one instance.
interface Change {
  removed?: boolean; // an instance of the opening, or a node of its scene file
  added?: NewInstance; // by a tick, perhaps after `removed`
  attributes?: Attributes;
  position?: number[];
  rotation?: number[];
}

// Follows the ticks that a daemon has applied. A session that is opened with opening() and gets ticks() has the same scene, targets,
// settings, limits, lens and clock as one that got every tick, and its camera is where the newest reply had it.
//
// The shot goes on. The camera's memory of the things that it had seen before is lost.
export class Snapshot {
  private readonly changes = new Map<bigint, Change>(); // in the order of the first change
  private readonly terms = create(TickSchema); // the newest targets, lens, settings, limits and tuning, and how far the world has been shifted since the opening
  private timeS = 0;
  private camera?: ObservedCamera;
  private kept?: ShotReport; // of the newest reply
  private shot?: Shot; // of the newest tick that had one

  constructor(private readonly first: OpenSession) {}

  // Hash of the scene that the opening names.
  get sceneHash(): string | undefined {
    const source = this.first.scene?.source;
    return source?.case === "hash" ? source.value : undefined;
  }

  set sceneHash(hash: string) {
    this.first.scene ??= create(SceneRefSchema);
    this.first.scene.source = {case: "hash", value: hash};
  }

  // Takes a tick that the daemon has applied.
  apply(tick: Tick): void {
    if (tick.worldShift) this.shiftWorld(tick.worldShift);
    if (tick.delta) this.applyDelta(tick.delta);
    if (tick.transforms) this.move(tick.transforms);
    this.takeTerms(tick);
    this.timeS = tick.timeS;
  }

  takeReply({pose, velocity, angularVelocity, shot}: CameraReply): void {
    this.camera = create(ObservedCameraSchema, {pose, velocity, angularVelocity});
    this.kept = shot;
  }

  private shiftWorld(shift: Vec3): void {
    this.terms.worldShift = shifted(this.terms.worldShift, shift, 1);
    for (const change of this.changes.values()) {
      if (change.added) change.added = {...change.added, pose: shiftedPose(change.added.pose, shift, 1)};
      if (change.position) {
        const [x = 0, y = 0, z = 0] = change.position;
        change.position = [x + shift.x, y + shift.y, z + shift.z];
      }
    }
    if (this.camera) this.camera = {...this.camera, pose: shiftedPose(this.camera.pose, shift, 1)};
  }

  // The first message of the session that goes on: as at first, and before the world was shifted, but with the camera where it is now.
  opening(): OpenSession {
    const request = clone(OpenSessionSchema, this.first);
    request.shot = this.shot ?? request.shot;
    if (this.camera) request.camera = shiftedPose(this.camera.pose, this.terms.worldShift, -1), this.goOnWithShot(request);
    return request;
  }

  // The shot as it was asked for last, from where it is now.
  private goOnWithShot(request: OpenSession): void {
    const shot = request.shot ? clone(ShotSchema, request.shot) : create(ShotSchema);
    shot.cut = false;
    shot.blendS = 0;
    if (request.shot) request.shot = shot;
    const {side, height, distance, placeX = 0, placeY = 0} = this.kept ?? {};
    if (!side || !height || !distance || distance.asked <= 0) return;
    if (shot.sideRad === undefined || shot.orbitRadps || shot.eitherSide) shot.sideRad = side.asked;
    shot.eitherSide = false;
    shot.heightRad ??= height.asked;
    if (!shot.far.case) shot.far = {case: "distance", value: distance.asked};
    if (!shot.places.length && (placeX || placeY)) shot.places.push(create(Shot_PlaceSchema, {x: placeX, y: placeY}));
    request.shot = shot;
  }

  // The ticks that follow the opening; they get no replies of their own. nextSequence: of the tick after them. Empty before the first
  // reply.
  ticks(nextSequence: bigint): Tick[] {
    if (!this.camera) return [];
    const all = [...this.changes];
    const turned = all.filter(([, change]) => change.rotation);
    const moved = all.filter(([, change]) => change.position && !change.rotation);
    const {targets, lens, settings, limits, tuning, worldShift} = this.terms;
    const first = create(TickSchema, {
      observedCamera: this.camera, delta: this.delta(), transforms: transformsOf(turned.length ? turned : moved),
      targets, lens, settings, limits, tuning, worldShift,
    });
    // Rotations are sent for all instances of a tick or for none.
    const ticks = turned.length && moved.length ? [first, create(TickSchema, {transforms: transformsOf(moved)})] : [first];
    ticks.forEach((tick, i) => {
      tick.sequence = nextSequence - BigInt(ticks.length - i);
      tick.timeS = this.timeS;
      tick.stepControl = create(StepControlSchema, {mergeIntoNext: true});
    });
    return ticks;
  }

  private change(id: bigint): Change {
    let change = this.changes.get(id);
    if (!change) this.changes.set(id, (change = {}));
    return change;
  }

  private applyDelta(delta: SceneDelta): void {
    for (const id of delta.removedIds) {
      const known = this.changes.get(id);
      this.changes.delete(id);
      if (known?.removed || !known?.added) this.changes.set(id, {removed: true});
      this.forgetInTargets(id);
    }
    for (const added of delta.addedInstances) this.change(added.id).added = added;
    for (const {id, attributes} of delta.changedInstances) this.change(id).attributes = attributes;
  }

  // A list of targets may name existing instances only.
  private forgetInTargets(id: bigint): void {
    for (const target of this.terms.targets?.targets ?? []) {
      target.attachedIds = target.attachedIds.filter((other) => other !== id);
      target.ignoredIds = target.ignoredIds.filter((other) => other !== id);
      target.partIds = target.partIds.filter((other) => other !== id);
    }
  }

  private move({ids, positions, rotations}: Transforms): void {
    ids.forEach((id, i) => {
      const change = this.change(id);
      change.position = positions.slice(3 * i, 3 * i + 3);
      if (rotations.length) change.rotation = rotations.slice(4 * i, 4 * i + 4);
    });
  }

  private takeTerms(tick: Tick): void {
    const terms = this.terms;
    terms.targets = tick.targets ?? terms.targets;
    terms.lens = tick.lens ?? terms.lens;
    this.shot = tick.shot ?? this.shot;
    // A preset resets the settings and the tuning.
    if (tick.settings && tick.settings.preset !== Settings_Preset.UNSPECIFIED) terms.settings = terms.tuning = undefined;
    terms.settings = merged(SettingsSchema, terms.settings, tick.settings);
    terms.limits = merged(CameraLimitsSchema, terms.limits, tick.limits);
    terms.tuning = merged(TuningSchema, terms.tuning, tick.tuning);
  }

  private delta(): SceneDelta | undefined {
    const delta = create(SceneDeltaSchema);
    for (const [id, {removed, added, attributes}] of this.changes) {
      if (removed) delta.removedIds.push(id);
      if (added) delta.addedInstances.push(added);
      if (attributes) delta.changedInstances.push(create(AttributeChangeSchema, {id, attributes}));
    }
    return delta.removedIds.length + delta.addedInstances.length + delta.changedInstances.length ? delta : undefined;
  }
}

// Both together; the fields of `change` win.
function merged<Desc extends DescMessage>(schema: Desc, base: MessageShape<Desc> | undefined, change: MessageShape<Desc> | undefined) {
  if (!change) return base;
  return mergeFromBinary(schema, base ? clone(schema, base) : create(schema), toBinary(schema, change));
}

function transformsOf(changes: [bigint, Change][]): Transforms | undefined {
  if (!changes.length) return undefined;
  return create(TransformsSchema, {
    ids: changes.map(([id]) => id),
    positions: changes.flatMap(([, change]) => change.position ?? []),
    rotations: changes.flatMap(([, change]) => change.rotation ?? []),
  });
}

// True if the tick was applied and only its step failed (see TickError).
export function wasApplied(error: TickError): boolean {
  return [TickError_Code.INTERNAL, TickError_Code.UNAVAILABLE].includes(error.code) && !error.fieldViolations.length;
}
