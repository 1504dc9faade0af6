// Where the targets are, as the game said, and a camera that follows them without a daemon.
import type {NewInstance, Target} from "./gen/sightline/v1/scene_pb.js";
import type {OpenSession, Tick} from "./gen/sightline/v1/session_pb.js";
import {ORIGIN, length, minus, plus, read, times} from "./rotations.js";
import type {Vector} from "./shapes.js";

const CARRY_S = 0.1; // time constant with which the motion relative to the targets dies away
const STEPS = 5;

// Positions by id that are newer than the newest tick.
export type Drawn = ReadonlyMap<bigint, Vector>;

// Follows the positions of the instances and the list of targets.
export class TargetPlaces {
  private positions = new Map<bigint, Vector>();
  private weights: [id: bigint, weight: number][] = [];

  constructor(opening: OpenSession) {
    this.addAll(opening.instances);
    this.choose(opening.targets);
  }

  shift(by: Vector): void {
    this.positions = new Map([...this.positions].map(([id, position]) => [id, plus(position, by)]));
  }

  apply(tick: Tick): void {
    for (const id of tick.delta?.removedIds ?? []) this.positions.delete(id);
    this.addAll(tick.delta?.addedInstances ?? []);
    const {ids = [], positions = []} = tick.transforms ?? {};
    ids.forEach((id, i) => {
      const place = positions.slice(3 * i, 3 * i + 3);
      if (place.length === 3 && place.every(Number.isFinite)) this.positions.set(id, place as Vector);
    });
    if (tick.targets) this.choose(tick.targets.targets);
  }

  // The targets that make up the centre, and their weights.
  counted(): [id: bigint, weight: number][] {
    return this.weights.filter(([id, weight]) => weight > 0 && this.positions.has(id));
  }

  position(id: bigint, drawn: Drawn): Vector | undefined {
    return drawn.get(id) ?? this.positions.get(id);
  }

  // The weighted mean of the targets. Undefined: there is none whose position is known.
  centre(drawn: Drawn): Vector | undefined {
    let total = 0, mean = ORIGIN;
    for (const [id, weight] of this.counted()) {
      total += weight;
      mean = plus(mean, times(weight, this.position(id, drawn)!));
    }
    return total > 0 ? times(1 / total, mean) : undefined;
  }

  private addAll(instances: NewInstance[]): void {
    for (const {id, pose} of instances) this.positions.set(id, read(pose?.position));
  }

  private choose(targets: Target[]): void {
    this.weights = targets.map(({id, weight}) => [id, weight ?? 1]);
  }
}

// Keeps the camera's place relative to the targets' centre. Its motion relative to them dies away. It turns no more.
export class Follower {
  constructor(private readonly offset: Vector, private readonly velocity: Vector, private readonly sinceS: number) {}

  at(timeS: number, centre: Vector): Vector {
    const carriedS = CARRY_S * (1 - Math.exp(-Math.max(timeS - this.sinceS, 0) / CARRY_S));
    return plus(plus(centre, this.offset), times(carriedS, this.velocity));
  }
}

// The velocity of a point from its last positions. A single jump does not count.
export class RecentMotion {
  private last?: [timeS: number, position: Vector];
  private velocities: Vector[] = [];

  add(timeS: number, position: Vector): void {
    if (this.last) {
      if (timeS <= this.last[0]) return;
      this.velocities = [...this.velocities.slice(1 - STEPS), times(1 / (timeS - this.last[0]), minus(position, this.last[1]))];
    }
    this.last = [timeS, position];
  }

  shift(by: Vector): void {
    if (this.last) this.last = [this.last[0], plus(this.last[1], by)];
  }

  // The mean of the last steps without the fastest.
  velocity(): Vector {
    const slower = [...this.velocities].sort((a, b) => length(a) - length(b)).slice(0, -1);
    return slower.reduce((mean, step) => plus(mean, times(1 / slower.length, step)), ORIGIN);
  }
}
