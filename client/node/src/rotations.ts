// Arithmetic of vectors and rotations. A quaternion is [x, y, z, w]; a turn is a vector along its axis, as long as its angle in radians.
// The same formulae hold in right-handed and in left-handed frames, because the contract states turns by the frame's own rule.
import type {Quaternion, Vector} from "./shapes.js";

type Fields = {x: number; y: number; z: number} | undefined;

export const ORIGIN: Vector = [0, 0, 0];

export const read = (v: Fields): Vector => (v ? [v.x, v.y, v.z] : ORIGIN);

export const readRotation = (q: {x: number; y: number; z: number; w: number} | undefined): Quaternion => (q ? unit([q.x, q.y, q.z, q.w]) : [0, 0, 0, 1]);

export const plus = (a: Vector, b: Vector): Vector => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];

export const minus = (a: Vector, b: Vector): Vector => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];

export const times = (factor: number, a: Vector): Vector => [factor * a[0], factor * a[1], factor * a[2]];

export const length = (a: Vector): number => Math.hypot(...a);

// The rotation that turns by q first, then by p.
export function product([a, b, c, d]: Quaternion, [e, f, g, h]: Quaternion): Quaternion {
  return [d * e + a * h + b * g - c * f, d * f - a * g + b * h + c * e, d * g + a * f - b * e + c * h, d * h - a * e - b * f - c * g];
}

export const inverse = (q: Quaternion): Quaternion => [-q[0], -q[1], -q[2], q[3]];

export function unit(q: Quaternion): Quaternion {
  const size = Math.hypot(...q);
  return size > 0 ? [q[0] / size, q[1] / size, q[2] / size, q[3] / size] : [0, 0, 0, 1];
}

export function rotationOf(turn: Vector): Quaternion {
  const angle = length(turn);
  const share = angle > 1e-9 ? Math.sin(angle / 2) / angle : 0.5;
  return [share * turn[0], share * turn[1], share * turn[2], Math.cos(angle / 2)];
}

// The shorter way: at most half a turn.
export function turnOf(q: Quaternion): Vector {
  const sign = q[3] < 0 ? -1 : 1;
  const size = Math.hypot(q[0], q[1], q[2]);
  const share = size > 1e-9 ? (2 * Math.atan2(size, sign * q[3])) / size : 2;
  return times(sign * share, [q[0], q[1], q[2]]);
}
