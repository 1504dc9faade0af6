// Short ways to write shapes and places.
import type {MessageInitShape} from "@bufbuild/protobuf";

import type {ShapeSchema, TransformsSchema} from "./gen/sightline/v1/scene_pb.js";

export type Vector = [x: number, y: number, z: number];
export type Quaternion = [x: number, y: number, z: number, w: number];
type Shape = MessageInitShape<typeof ShapeSchema>;

export function vector([x, y, z]: Vector) {
  return {x, y, z};
}

// Whole sizes along x, y and z. A ground or a wall is a flat box. Like every shape, it is centred on the place of its instance.
export function box(width: number, height: number, depth: number): Shape {
  return {shape: {case: "box", value: {halfExtent: vector([width / 2, height / 2, depth / 2])}}};
}

export function sphere(radius: number): Shape {
  return {shape: {case: "sphere", value: {radius}}};
}

// An upright capsule; `height` is from end to end.
export function capsule(radius: number, height: number): Shape {
  return {shape: {case: "capsule", value: {radius, halfHeight: height / 2 - radius}}};
}

// An instance for the opening.
export function instance(id: bigint, shape: Shape, position: Vector) {
  return {id, geometry: {case: "shape" as const, value: shape}, pose: {position: vector(position)}};
}

// Where instances are now, for Tick.transforms; the others stay where they are. Give a rotation for all of them or for none; without, the
// rotations stay as they are.
export function transforms(places: Iterable<[id: bigint, position: Vector, rotation?: Quaternion]>): MessageInitShape<typeof TransformsSchema> {
  const moved = {ids: [] as bigint[], positions: [] as number[], rotations: [] as number[]};
  for (const [id, position, rotation] of places) {
    moved.ids.push(id);
    moved.positions.push(...position);
    moved.rotations.push(...(rotation ?? []));
  }
  return moved;
}
