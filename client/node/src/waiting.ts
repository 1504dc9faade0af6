// Ticks that wait for a daemon that is late or away.
import {clone, create, toBinary} from "@bufbuild/protobuf";

import {QueueFull} from "./errors.js";
import {TransformsSchema, type Transforms} from "./gen/sightline/v1/scene_pb.js";
import {TickSchema, type ObservedCamera, type Tick} from "./gen/sightline/v1/session_pb.js";

export const MOST_WAITING = 4096;
const MOST_PARTS = 8; // of what is folded: with and without rotation, velocity and angular velocity

interface Place {
  position: number[];
  rotation: number[]; // empty: it stays as it is
  velocity: number[]; // empty: the daemon derives it
  angularVelocity: number[]; // empty: the daemon derives it
}

// A tick that is kept whole, or several in one that only say where things are.
class Entry {
  suggested?: ObservedCamera; // what the player sees instead of the daemon's camera
  private sequence = 0n;
  private timeS = 0;
  private dtS = 0;
  private hasDt = false; // some tick said its dtS
  private readonly folded: Tick[] = []; // the first MOST_PARTS
  private readonly places = new Map<bigint, Place>();
  private observed?: ObservedCamera; // of the newest tick

  constructor(readonly kept?: Tick) {}

  fold(tick: Tick, dtS: number): void {
    this.sequence = tick.sequence;
    this.timeS = tick.timeS;
    this.dtS += dtS;
    this.hasDt ||= tick.dtS !== undefined;
    this.observed = tick.observedCamera;
    if (this.folded.length < MOST_PARTS) this.folded.push(tick);
    const {ids, positions, rotations, velocities, angularVelocities} = tick.transforms ?? create(TransformsSchema);
    ids.forEach((id, i) => {
      const [position, velocity, angularVelocity] = [positions, velocities, angularVelocities].map((values) => values.slice(3 * i, 3 * i + 3));
      const rotation = rotations.length ? rotations.slice(4 * i, 4 * i + 4) : (this.places.get(id)?.rotation ?? []);
      this.places.set(id, {position, rotation, velocity, angularVelocity});
    });
  }

  ticks(): Tick[] {
    const ticks = this.kept ? [this.kept] : this.parts();
    const last = ticks.at(-1)!;
    last.observedCamera ??= this.observed ?? this.suggested;
    return ticks;
  }

  // A message has rotations for all of its instances or for none, and so with velocities and angular velocities. Each part takes the number of a
  // tick. Where there are fewer ticks than parts, the ticks go as they came.
  private parts(): Tick[] {
    const kinds = new Map<string, Transforms>();
    for (const [id, {position, rotation, velocity, angularVelocity}] of this.places) {
      const kind = `${rotation.length} ${velocity.length} ${angularVelocity.length}`;
      const moved = kinds.get(kind) ?? create(TransformsSchema);
      kinds.set(kind, moved);
      moved.ids.push(id);
      moved.positions.push(...position);
      moved.rotations.push(...rotation);
      moved.velocities.push(...velocity);
      moved.angularVelocities.push(...angularVelocity);
    }
    if (kinds.size > this.folded.length) return this.folded;
    const all = kinds.size ? [...kinds.values()] : [undefined];
    return all.map((transforms, i) => create(TickSchema, {
      sequence: this.sequence - BigInt(all.length - 1 - i), timeS: this.timeS, dtS: this.hasDt ? (i ? 0 : this.dtS) : undefined, transforms,
    }));
  }
}

// All numbers are there and finite, and no id comes twice.
function isWhole({ids, positions, rotations, velocities, angularVelocities}: Transforms): boolean {
  const n = ids.length;
  if (positions.length !== 3 * n || ![0, 4 * n].includes(rotations.length) || new Set(ids).size !== n) return false;
  if (![velocities, angularVelocities].every((values) => [0, 3 * n].includes(values.length))) return false;
  return [positions, rotations, velocities, angularVelocities].every((values) => values.every(Number.isFinite));
}

// Ticks in their order. Those that carry only time and places, and perhaps an observed camera that is no cut, fold into one: the newest place
// counts for each id. Every other tick is kept whole, so that a refusal hits it alone; MOST_WAITING of them may wait.
export class WaitingTicks {
  private readonly entries: Entry[] = [];
  private timeS?: number; // of the newest tick

  get size(): number {
    return this.entries.length;
  }

  // Takes a tick with its number. Throws QueueFull.
  add(tick: Tick): void {
    const dtS = tick.dtS ?? (this.timeS === undefined ? 0 : tick.timeS - this.timeS);
    const plain = this.isPlain(tick);
    let last = this.entries.at(-1);
    if (!plain || !last || last.kept) {
      if (this.entries.length >= MOST_WAITING) throw new QueueFull(`${MOST_WAITING} ticks wait for a daemon`);
      this.entries.push((last = new Entry(plain ? undefined : tick)));
    }
    if (plain) last.fold(tick, dtS);
    last.suggested = undefined;
    this.timeS = tick.timeS;
  }

  // Goes with the newest tick as its observed camera, if that tick waits and has none.
  suggest(observed: ObservedCamera): void {
    const last = this.entries.at(-1);
    if (last) last.suggested = observed;
  }

  // The ticks to send next, each of which gets an answer. Empty: none waits.
  take(): Tick[] {
    return this.entries.shift()?.ticks() ?? [];
  }

  // Only a tick that a daemon is likely to take is folded.
  private isPlain(tick: Tick): boolean {
    if (tick.observedCamera?.cut || ![tick.timeS, tick.dtS ?? 0].every(Number.isFinite)) return false;
    if ((tick.dtS ?? 0) < 0 || (this.timeS !== undefined && tick.timeS < this.timeS)) return false;
    if (tick.transforms && !isWhole(tick.transforms)) return false;
    const rest = clone(TickSchema, {...tick, transforms: undefined, observedCamera: undefined});
    rest.sequence = 0n;
    rest.timeS = 0;
    rest.dtS = undefined;
    return toBinary(TickSchema, rest).length === 0;
  }
}
