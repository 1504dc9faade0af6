package sightline

import (
	"slices"

	"google.golang.org/protobuf/proto"

	v1 "sightline.dev/go/sightline/v1"
)

// Source is the origin of a shown pose.
type Source string

const (
	SourceReply     Source = "reply"     // the daemon's answer to this tick
	SourcePredicted Source = "predicted" // an earlier answer, brought up to date
	SourceFallback  Source = "fallback"  // no daemon answers: the camera keeps its place relative to the targets
	SourceBlend     Source = "blend"     // the way from the fallback to the daemon's camera
)

// blend is the fallback's pose minus the daemon's, where they met.
type blend struct {
	sinceS      float64
	shift, turn Vector
	zoom        float64
}

func (b *blend) left(timeS, blendS float64) float64 {
	x := 1.0
	if blendS > 0 {
		x = min(max((timeS-b.sinceS)/blendS, 0), 1)
	}
	return 1 - x*x*(3-2*x)
}

type timedOffset struct {
	timeS  float64
	offset Vector
}

type worldShift struct {
	sequence uint64
	by       Vector
}

// display is what the player sees: the replies as sampled, a camera that follows the targets while none come, and the way back. It has no
// clock and no network: timeS is the game's, and the caller says whether the daemon is silent.
type display struct {
	places     *targetPlaces
	newest     *v1.CameraReply
	blendS     float64
	sampler    *PoseSampler // of the replies that count: while there is a follower, those that end the fallback
	shown      Sample
	shownS     float64
	centre     *Vector       // of the targets when that was shown
	offsets    []timedOffset // the camera minus the centre at the last two times
	follower   *follower
	followed   bool   // since the follower began, it was shown
	countsFrom uint64 // replies to ticks from this number on end the fallback
	blend      *blend
	shifts     []worldShift // by ticks that no reply covers so far
	motion     recentMotion
}

func newDisplay(opening *v1.OpenSession, blendS float64) *display {
	camera := opening.GetCamera()
	shown := Sample{read(camera.GetPosition()), readRotation(camera.GetRotation()), opening.GetLens().GetFieldOfView(), false}
	places := newTargetPlaces(opening)
	d := &display{places: places, blendS: blendS, sampler: &PoseSampler{}, shown: shown, centre: places.centre(nil)}
	d.follower = &follower{offset: d.offset()} // there is no reply so far, so the camera follows from the start
	return d
}

func (d *display) offset() Vector {
	if d.centre == nil {
		return Vector{}
	}
	return d.shown.Position.minus(*d.centre)
}

func (d *display) takeTick(tick *v1.Tick) {
	if tick.GetWorldShift() != nil {
		d.shiftWorld(tick.GetSequence(), read(tick.GetWorldShift()))
	}
	before := d.places.counted()
	d.places.apply(tick)
	if slices.Equal(before, d.places.counted()) {
		return
	}
	// The centre may jump, and the camera must not.
	d.centre, d.offsets = d.places.centre(nil), nil
	if d.follower != nil && d.centre != nil {
		d.follower = &follower{d.shown.Position.minus(*d.centre), Vector{}, tick.GetTimeS()}
	}
}

func (d *display) shiftWorld(sequence uint64, by Vector) {
	d.shifts = append(d.shifts, worldShift{sequence, by})
	d.shown.Position = d.shown.Position.plus(by)
	d.motion.position = d.motion.position.plus(by)
	d.places.shift(by)
	d.sampler.Shift(by)
	if d.centre != nil {
		centre := d.centre.plus(by)
		d.centre = &centre
	}
}

// inThisWorld is the reply where the world has been shifted since its tick.
func (d *display) inThisWorld(reply *v1.CameraReply) *v1.CameraReply {
	d.shifts = slices.DeleteFunc(d.shifts, func(shift worldShift) bool { return shift.sequence <= reply.GetSequence() })
	if len(d.shifts) == 0 {
		return reply
	}
	position := read(reply.GetPose().GetPosition())
	for _, shift := range d.shifts {
		position = position.plus(shift.by)
	}
	moved := proto.Clone(reply).(*v1.CameraReply)
	moved.Pose = &v1.Pose3{Position: Vec(position[0], position[1], position[2]), Rotation: reply.GetPose().GetRotation()}
	return moved
}

func (d *display) takeReply(reply *v1.CameraReply) {
	d.newest = reply
	if d.follower == nil || reply.GetSequence() >= d.countsFrom {
		d.sampler.Add(d.inThisWorld(reply))
	}
}

// follow: the daemon is silent. countsFrom: the first tick whose reply ends the fallback.
func (d *display) follow(countsFrom uint64) {
	if d.follower == nil {
		d.follower, d.followed = &follower{d.offset(), d.relativeVelocity(), d.shownS}, false
	} else if d.countsFrom > 0 {
		return
	}
	d.countsFrom, d.sampler, d.blend = countsFrom, &PoseSampler{}, nil
}

// relativeVelocity is no faster than the camera of the newest reply: targets that are put elsewhere do not throw it.
func (d *display) relativeVelocity() Vector {
	if len(d.offsets) < 2 || d.newest == nil {
		return Vector{}
	}
	start, end := d.offsets[0], d.offsets[1]
	velocity := end.offset.minus(start.offset).times(1 / (end.timeS - start.timeS))
	most, speed := read(d.newest.GetVelocity()).length(), velocity.length()
	if speed <= most {
		return velocity
	}
	return velocity.times(most / speed)
}

// show is the camera at a game time. drawn: positions of targets at that time, if they are newer than the newest tick.
func (d *display) show(timeS float64, drawn Drawn) (shown Sample, source Source) {
	centre := d.places.centre(drawn)
	daemon, ok := d.sampler.Sample(timeS, d.places.position(d.sampler.TargetID(), drawn))
	if !ok { // there is a follower until there is a reply
		shown, source, d.followed = d.following(timeS, centre), SourceFallback, true
	} else {
		if d.follower != nil {
			d.goBack(d.following(timeS, centre), daemon, timeS)
		}
		shown, source = d.blended(daemon, timeS)
	}
	d.remember(shown, timeS, centre)
	return shown, source
}

func (d *display) following(timeS float64, centre *Vector) Sample {
	shown := d.shown
	shown.Cut = false
	if centre != nil {
		shown.Position = d.follower.at(timeS, *centre)
	}
	return shown
}

func (d *display) goBack(followed, daemon Sample, timeS float64) {
	d.follower = nil
	if !d.followed {
		return
	}
	turn := followed.Rotation.after(daemon.Rotation.inverse()).turn()
	d.blend = &blend{timeS, followed.Position.minus(daemon.Position), turn, followed.FieldOfView - daemon.FieldOfView}
}

func (d *display) blended(shown Sample, timeS float64) (Sample, Source) {
	left := 0.0
	if d.blend != nil && !shown.Cut {
		left = d.blend.left(timeS, d.blendS)
	}
	if left == 0 {
		d.blend = nil
		return shown, SourcePredicted
	}
	shown.Position = shown.Position.plus(d.blend.shift.times(left))
	shown.Rotation = rotationOf(d.blend.turn.times(left)).after(shown.Rotation)
	shown.FieldOfView += left * d.blend.zoom
	return shown, SourceBlend
}

func (d *display) remember(shown Sample, timeS float64, centre *Vector) {
	d.shown, d.shownS, d.centre = shown, timeS, centre
	d.motion.add(timeS, shown.Position)
	if centre == nil || shown.Cut {
		d.offsets = nil
	}
	n := len(d.offsets)
	if centre != nil && (n == 0 || timeS > d.offsets[n-1].timeS) {
		d.offsets = append(d.offsets[max(n-1, 0):], timedOffset{timeS, shown.Position.minus(*centre)})
	}
}

// observed is the camera that the player sees, so that the daemon goes on from it.
func (d *display) observed() *v1.ObservedCamera {
	p, q, v := d.shown.Position, d.shown.Rotation, d.motion.velocity()
	pose := &v1.Pose3{Position: Vec(p[0], p[1], p[2]), Rotation: &v1.Quat{X: q[0], Y: q[1], Z: q[2], W: q[3]}}
	return &v1.ObservedCamera{Pose: pose, Velocity: Vec(v[0], v[1], v[2])}
}
