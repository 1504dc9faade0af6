package sightline

import (
	"math"

	v1 "sightline.dev/go/sightline/v1"
)

// Vector is x, y, z in the client's frame.
type Vector [3]float64

// Quaternion is x, y, z, w. The formulae of this file hold in right-handed and in left-handed frames, because the contract states turns by
// the frame's own rule. A turn is a vector along its axis, as long as its angle in radians.
type Quaternion [4]float64

func read(v *v1.Vec3) Vector { return Vector{v.GetX(), v.GetY(), v.GetZ()} }

func readRotation(q *v1.Quat) Quaternion {
	return Quaternion{q.GetX(), q.GetY(), q.GetZ(), q.GetW()}.unit()
}

func (a Vector) plus(b Vector) Vector  { return Vector{a[0] + b[0], a[1] + b[1], a[2] + b[2]} }
func (a Vector) minus(b Vector) Vector { return Vector{a[0] - b[0], a[1] - b[1], a[2] - b[2]} }
func (a Vector) times(factor float64) Vector {
	return Vector{factor * a[0], factor * a[1], factor * a[2]}
}
func (a Vector) length() float64 { return math.Sqrt(a[0]*a[0] + a[1]*a[1] + a[2]*a[2]) }

func (a Vector) isFinite() bool {
	sum := a[0] + a[1] + a[2]
	return !math.IsNaN(sum) && !math.IsInf(sum, 0)
}

// after is the rotation that turns by q first, then by p.
func (p Quaternion) after(q Quaternion) Quaternion {
	return Quaternion{
		p[3]*q[0] + p[0]*q[3] + p[1]*q[2] - p[2]*q[1],
		p[3]*q[1] - p[0]*q[2] + p[1]*q[3] + p[2]*q[0],
		p[3]*q[2] + p[0]*q[1] - p[1]*q[0] + p[2]*q[3],
		p[3]*q[3] - p[0]*q[0] - p[1]*q[1] - p[2]*q[2],
	}
}

func (p Quaternion) inverse() Quaternion { return Quaternion{-p[0], -p[1], -p[2], p[3]} }

// unit is the identity for a rotation that is absent.
func (p Quaternion) unit() Quaternion {
	length := math.Sqrt(p[0]*p[0] + p[1]*p[1] + p[2]*p[2] + p[3]*p[3])
	if length == 0 {
		return Quaternion{0, 0, 0, 1}
	}
	return Quaternion{p[0] / length, p[1] / length, p[2] / length, p[3] / length}
}

func rotationOf(turn Vector) Quaternion {
	angle, share := turn.length(), 0.5
	if angle > 1e-9 {
		share = math.Sin(angle/2) / angle
	}
	return Quaternion{share * turn[0], share * turn[1], share * turn[2], math.Cos(angle / 2)}
}

// turn is the shorter way: at most half a turn.
func (p Quaternion) turn() Vector {
	axis, share := Vector{p[0], p[1], p[2]}, 2.0
	sign := math.Copysign(1, p[3])
	if length := axis.length(); length > 1e-9 {
		share = 2 * math.Atan2(length, sign*p[3]) / length
	}
	return axis.times(sign * share)
}
