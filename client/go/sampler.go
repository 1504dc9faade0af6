package sightline

import (
	"math"

	v1 "sightline.dev/go/sightline/v1"
)

const (
	fullS = 0.15 // a reply's velocities carry the camera on in full for so long
	stopS = 0.35 // until then they ease out
	fadeS = 0.02 // what a new reply changes fades in with this time constant
)

// Sample is a camera that can be drawn. Cut: it jumped since the former sample; reset what smooths over frames.
type Sample struct {
	Position    Vector
	Rotation    Quaternion
	FieldOfView float64
	Cut         bool
}

// carriedS is for how long a reply's velocities have carried the camera at this age: at most 0.25 s.
func carriedS(ageS float64) float64 {
	if ageS <= fullS {
		return max(ageS, -fullS)
	}
	easing := min(ageS, stopS) - fullS
	return fullS + easing - easing*easing/(2*(stopS-fullS))
}

// newestReply is the part of a reply that the sampler needs.
type newestReply struct {
	timeS                     float64
	pose                      Sample
	velocity, angularVelocity Vector
	targetID                  uint64
	target                    *Vector // where the target was
}

func newNewestReply(reply *v1.CameraReply) *newestReply {
	pose := Sample{Position: read(reply.GetPose().GetPosition()), Rotation: readRotation(reply.GetPose().GetRotation()), FieldOfView: reply.GetFieldOfView()}
	made := &newestReply{reply.GetPoseTimeS(), pose, read(reply.GetVelocity()), read(reply.GetAngularVelocity()), reply.GetRelativePose().GetTargetId(), nil}
	if unrotated := reply.GetRelativePose().GetUnrotatedPose(); made.targetID != 0 && unrotated != nil {
		target := pose.Position.minus(read(unrotated.GetPosition()))
		made.target = &target
	}
	return made
}

func (r *newestReply) shift(by Vector) {
	if r == nil {
		return
	}
	r.pose.Position = r.pose.Position.plus(by)
	if r.target != nil {
		target := r.target.plus(by)
		r.target = &target
	}
}

func (r *newestReply) at(timeS float64, target *Vector) Sample {
	age := timeS - r.timeS
	carried, shown := carriedS(age), r.pose
	shown.Position = shown.Position.plus(r.velocity.times(carried))
	if age > fullS && target != nil && r.target != nil {
		shown.Position = shown.Position.plus(target.minus(*r.target).times(1 - carried/age))
	}
	shown.Rotation = rotationOf(r.angularVelocity.times(carried)).after(shown.Rotation)
	return shown
}

// PoseSampler gives the camera at any time from the newest reply, for a renderer that is faster than the replies, or ahead of them. It only
// computes. Its zero value is ready; client/SAMPLING.md states the rules.
//
//	sampler.Add(reply)                              // each reply, as it comes
//	shown, ok := sampler.Sample(timeS, &target)     // each frame: game time, and where sampler.TargetID() is drawn
type PoseSampler struct {
	newest, former *newestReply // former: the one of the former sample, while a newer one waits to be shown
	sequence       uint64
	cut            bool     // a reply since the former sample was a cut
	timeS          *float64 // of the former sample
	// The remainder that fades away: the former sample minus the newest reply, at timeS.
	shift, turn Vector
	zoom        float64
}

// TargetID is the target whose position Sample takes; 0: none.
func (s *PoseSampler) TargetID() uint64 {
	if s.newest == nil {
		return 0
	}
	return s.newest.targetID
}

// Add takes a reply. False: it is not newer than the newest one, and is ignored.
func (s *PoseSampler) Add(reply *v1.CameraReply) bool {
	if s.newest != nil && reply.GetSequence() <= s.sequence {
		return false
	}
	if s.former == nil && s.timeS != nil {
		s.former = s.newest
	}
	s.sequence, s.newest = reply.GetSequence(), newNewestReply(reply)
	s.cut = s.cut || reply.GetCut()
	return true
}

// Shift says that the client's world has a new origin: the replies that were added lie elsewhere now (Tick.world_shift).
func (s *PoseSampler) Shift(by Vector) {
	s.newest.shift(by)
	s.former.shift(by)
}

// Sample is the camera at a game time. target: where TargetID is at that time; nil: only velocities carry the camera on. False: there is no
// reply so far.
func (s *PoseSampler) Sample(timeS float64, target *Vector) (Sample, bool) {
	if s.newest == nil {
		return Sample{}, false
	}
	s.fade(timeS)
	shown, former := s.newest.at(timeS, target), s.former
	shown.Cut, s.cut, s.former = s.cut, false, nil
	if shown.Cut {
		s.shift, s.turn, s.zoom = Vector{}, Vector{}, 0
	} else if former != nil {
		if former.targetID != s.newest.targetID {
			target = nil
		}
		before := former.at(timeS, target)
		s.shift = s.shift.plus(before.Position.minus(shown.Position))
		s.turn = rotationOf(s.turn).after(before.Rotation).after(shown.Rotation.inverse()).turn()
		s.zoom += before.FieldOfView - shown.FieldOfView
	}
	shown.Position = shown.Position.plus(s.shift)
	shown.Rotation = rotationOf(s.turn).after(shown.Rotation)
	shown.FieldOfView += s.zoom
	return shown, true
}

func (s *PoseSampler) fade(timeS float64) {
	if s.timeS != nil {
		if timeS <= *s.timeS {
			return
		}
		left := math.Exp(-(timeS - *s.timeS) / fadeS)
		s.shift, s.turn, s.zoom = s.shift.times(left), s.turn.times(left), s.zoom*left
	}
	s.timeS = &timeS
}
