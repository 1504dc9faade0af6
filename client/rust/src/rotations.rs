//! Arithmetic of vectors and rotations. The same formulae hold in right-handed and in left-handed frames, because the contract states turns by the
//! frame's own rule.
use crate::v1::{Quat, Vec3};

/// x, y, z in the client's frame.
pub type Vector = [f64; 3];

/// x, y, z, w. A turn is a vector along its axis, as long as its angle in radians.
pub type Quaternion = [f64; 4];

pub(crate) const ORIGIN: Vector = [0.0; 3];

pub(crate) fn read(v: Option<&Vec3>) -> Vector {
    v.map_or(ORIGIN, |v| [v.x, v.y, v.z])
}

pub(crate) fn read_rotation(q: Option<&Quat>) -> Quaternion {
    let q = q.map_or([0.0; 4], |q| [q.x, q.y, q.z, q.w]);
    let length = q.iter().map(|value| value * value).sum::<f64>().sqrt();
    if length > 0.0 {
        q.map(|value| value / length)
    } else {
        [0.0, 0.0, 0.0, 1.0]
    }
}

pub(crate) fn plus(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn times(factor: f64, a: Vector) -> Vector {
    a.map(|value| factor * value)
}

pub(crate) fn length(a: Vector) -> f64 {
    a.iter().map(|value| value * value).sum::<f64>().sqrt()
}

/// The rotation that turns by q first, then by p.
pub(crate) fn product(p: Quaternion, q: Quaternion) -> Quaternion {
    let ([a, b, c, d], [e, f, g, h]) = (p, q);
    [d * e + a * h + b * g - c * f, d * f - a * g + b * h + c * e, d * g + a * f - b * e + c * h, d * h - a * e - b * f - c * g]
}

pub(crate) fn inverse([x, y, z, w]: Quaternion) -> Quaternion {
    [-x, -y, -z, w]
}

pub(crate) fn rotation_of(turn: Vector) -> Quaternion {
    let angle = length(turn);
    let share = if angle > 1e-9 { (angle / 2.0).sin() / angle } else { 0.5 };
    [share * turn[0], share * turn[1], share * turn[2], (angle / 2.0).cos()]
}

/// The shorter way: at most half a turn.
pub(crate) fn turn_of([x, y, z, w]: Quaternion) -> Vector {
    let sign = if w < 0.0 { -1.0 } else { 1.0 };
    let size = length([x, y, z]);
    let share = if size > 1e-9 { 2.0 * size.atan2(sign * w) / size } else { 2.0 };
    times(sign * share, [x, y, z])
}
