package sightline

import (
	"slices"

	"google.golang.org/protobuf/proto"

	v1 "sightline.dev/go/sightline/v1"
)

// The changes that ticks made to one instance.
type change struct {
	removed    bool            // an instance of the opening, or a node of its scene file
	added      *v1.NewInstance // by a tick, perhaps after removed
	attributes *v1.Attributes
	position   []float64
	rotation   []float32
}

// snapshot is the state of a session as the client knows it, so that the session can go on in another daemon. It follows the ticks that a
// daemon has applied. A session that is opened with opening() and gets ticks() has the same scene, targets, settings, limits, lens and clock
// as one that got every tick, and its camera is where the newest reply had it.
//
// The shot goes on. The camera's memory of the things that it had seen before is lost.
type snapshot struct {
	first   *v1.OpenSession
	changes map[uint64]*change
	order   []uint64 // the keys of changes, in the order of the first change
	terms   *v1.Tick // the newest targets, lens, settings, limits and tuning, and how far the world has been shifted since the opening
	timeS   float64
	camera  *v1.ObservedCamera
	kept    *v1.ShotReport // of the newest reply
}

func newSnapshot(first *v1.OpenSession) *snapshot {
	return &snapshot{first: proto.Clone(first).(*v1.OpenSession), changes: map[uint64]*change{}, terms: &v1.Tick{}}
}

// useScene makes the opening name the scene.
func (s *snapshot) useScene(hash string) {
	if s.first.Scene == nil {
		s.first.Scene = &v1.SceneRef{}
	}
	s.first.Scene.Source = &v1.SceneRef_Hash{Hash: hash}
}

// apply takes a tick that the daemon has applied.
func (s *snapshot) apply(tick *v1.Tick) {
	if tick.GetWorldShift() != nil {
		s.shiftWorld(tick.GetWorldShift())
	}
	s.applyDelta(tick.GetDelta())
	s.move(tick.GetTransforms())
	s.takeTerms(tick)
	s.timeS = tick.GetTimeS()
}

func (s *snapshot) takeReply(reply *v1.CameraReply) {
	s.camera = &v1.ObservedCamera{Pose: reply.GetPose(), Velocity: reply.GetVelocity(), AngularVelocity: reply.GetAngularVelocity()}
	s.kept = reply.GetShot()
}

func (s *snapshot) shiftWorld(shift *v1.Vec3) {
	s.terms.WorldShift = shifted(s.terms.GetWorldShift(), shift, 1)
	for _, known := range s.changes {
		if known.added != nil {
			known.added = proto.Clone(known.added).(*v1.NewInstance)
			known.added.Pose = &v1.Pose3{Position: shifted(known.added.GetPose().GetPosition(), shift, 1), Rotation: known.added.GetPose().GetRotation()}
		}
		if len(known.position) == 3 {
			p := known.position
			known.position = []float64{p[0] + shift.GetX(), p[1] + shift.GetY(), p[2] + shift.GetZ()}
		}
	}
	if s.camera != nil {
		s.camera = proto.Clone(s.camera).(*v1.ObservedCamera)
		s.camera.Pose.Position = shifted(s.camera.GetPose().GetPosition(), shift, 1)
	}
}

func shifted(place, shift *v1.Vec3, sign float64) *v1.Vec3 {
	return &v1.Vec3{X: place.GetX() + sign*shift.GetX(), Y: place.GetY() + sign*shift.GetY(), Z: place.GetZ() + sign*shift.GetZ()}
}

// opening is the first message of the session that goes on: as at first, and before the world was shifted, but with the camera where it is now.
func (s *snapshot) opening() *v1.OpenSession {
	request := proto.Clone(s.first).(*v1.OpenSession)
	if s.camera != nil {
		request.Camera = &v1.Pose3{Position: shifted(s.camera.GetPose().GetPosition(), s.terms.GetWorldShift(), -1), Rotation: s.camera.GetPose().GetRotation()}
		s.goOnWithShot(request)
	}
	return request
}

// goOnWithShot asks for the shot as it was asked for last, from where it is now.
func (s *snapshot) goOnWithShot(request *v1.OpenSession) {
	if request.Shot != nil {
		request.Shot.Cut, request.Shot.BlendS = false, 0
	}
	if s.kept.GetDistance().GetAsked() <= 0 {
		return
	}
	if request.Shot == nil {
		request.Shot = &v1.Shot{}
	}
	shot := request.Shot
	if shot.SideRad == nil || shot.OrbitRadps != 0 || shot.EitherSide {
		shot.SideRad = proto.Float64(s.kept.GetSide().GetAsked())
	}
	shot.EitherSide = false
	if shot.HeightRad == nil {
		shot.HeightRad = proto.Float64(s.kept.GetHeight().GetAsked())
	}
	if shot.Far == nil {
		shot.Far = &v1.Shot_Distance{Distance: s.kept.GetDistance().GetAsked()}
	}
	if len(shot.Places) == 0 && (s.kept.GetPlaceX() != 0 || s.kept.GetPlaceY() != 0) {
		shot.Places = []*v1.Shot_Place{{X: s.kept.GetPlaceX(), Y: s.kept.GetPlaceY()}}
	}
}

// ticks are those that follow the opening; they get no replies of their own. nextSequence is that of the tick after them. There are none
// before the first reply.
func (s *snapshot) ticks(nextSequence uint64) []*v1.Tick {
	if s.camera == nil {
		return nil
	}
	turned := s.transforms(func(c *change) bool { return c.rotation != nil })
	moved := s.transforms(func(c *change) bool { return c.rotation == nil && c.position != nil })
	// Rotations are sent for all instances of a tick or for none.
	lists := []*v1.Transforms{turned, moved}
	lists = slices.DeleteFunc(lists, func(list *v1.Transforms) bool { return list == nil })
	if len(lists) == 0 {
		lists = []*v1.Transforms{nil}
	}
	var ticks []*v1.Tick
	for i, transforms := range lists {
		tick := &v1.Tick{}
		if i == 0 {
			tick = proto.Clone(s.terms).(*v1.Tick)
			tick.ObservedCamera, tick.Delta = s.camera, s.delta()
		}
		tick.Transforms = transforms
		tick.Sequence = nextSequence - uint64(len(lists)-i)
		tick.TimeS = s.timeS
		tick.StepControl = &v1.StepControl{MergeIntoNext: true}
		ticks = append(ticks, tick)
	}
	return ticks
}

func (s *snapshot) change(id uint64) *change {
	if s.changes[id] == nil {
		s.changes[id] = &change{}
		s.order = append(s.order, id)
	}
	return s.changes[id]
}

func (s *snapshot) forget(id uint64) {
	delete(s.changes, id)
	s.order = slices.DeleteFunc(s.order, func(other uint64) bool { return other == id })
}

func (s *snapshot) applyDelta(delta *v1.SceneDelta) {
	for _, id := range delta.GetRemovedIds() {
		known := s.changes[id]
		s.forget(id)
		if known == nil || known.removed || known.added == nil {
			s.change(id).removed = true
		}
		s.forgetInTargets(id)
	}
	for _, added := range delta.GetAddedInstances() {
		s.change(added.GetId()).added = added
	}
	for _, changed := range delta.GetChangedInstances() {
		s.change(changed.GetId()).attributes = changed.GetAttributes()
	}
}

// A list of targets may name existing instances only.
func (s *snapshot) forgetInTargets(id uint64) {
	isIt := func(other uint64) bool { return other == id }
	for _, target := range s.terms.GetTargets().GetTargets() {
		target.AttachedIds = slices.DeleteFunc(target.AttachedIds, isIt)
		target.IgnoredIds = slices.DeleteFunc(target.IgnoredIds, isIt)
		target.PartIds = slices.DeleteFunc(target.PartIds, isIt)
	}
}

func (s *snapshot) move(moved *v1.Transforms) {
	for i, id := range moved.GetIds() {
		c := s.change(id)
		c.position = moved.Positions[3*i : 3*i+3]
		if len(moved.Rotations) > 0 {
			c.rotation = moved.Rotations[4*i : 4*i+4]
		}
	}
}

func (s *snapshot) takeTerms(tick *v1.Tick) {
	if tick.Targets != nil {
		s.terms.Targets = tick.Targets
	}
	if tick.Lens != nil {
		s.terms.Lens = tick.Lens
	}
	if tick.Shot != nil {
		s.first.Shot = proto.Clone(tick.Shot).(*v1.Shot)
	}
	if tick.GetSettings().GetPreset() != v1.Settings_PRESET_UNSPECIFIED { // resets the settings and the tuning
		s.terms.Settings, s.terms.Tuning = nil, nil
	}
	proto.Merge(s.terms, &v1.Tick{Settings: tick.Settings, Limits: tick.Limits, Tuning: tick.Tuning})
}

func (s *snapshot) delta() *v1.SceneDelta {
	delta := &v1.SceneDelta{}
	for _, id := range s.order {
		c := s.changes[id]
		if c.removed {
			delta.RemovedIds = append(delta.RemovedIds, id)
		}
		if c.added != nil {
			delta.AddedInstances = append(delta.AddedInstances, c.added)
		}
		if c.attributes != nil {
			delta.ChangedInstances = append(delta.ChangedInstances, &v1.AttributeChange{Id: id, Attributes: c.attributes})
		}
	}
	if proto.Size(delta) == 0 {
		return nil
	}
	return delta
}

func (s *snapshot) transforms(takes func(*change) bool) *v1.Transforms {
	var moved *v1.Transforms
	for _, id := range s.order {
		c := s.changes[id]
		if !takes(c) {
			continue
		}
		if moved == nil {
			moved = &v1.Transforms{}
		}
		moved.Ids = append(moved.Ids, id)
		moved.Positions = append(moved.Positions, c.position...)
		moved.Rotations = append(moved.Rotations, c.rotation...)
	}
	return moved
}

// wasApplied says whether the tick was applied and only its step failed (see TickError).
func wasApplied(refusal *v1.TickError) bool {
	code := refusal.GetCode()
	return (code == v1.TickError_CODE_INTERNAL || code == v1.TickError_CODE_UNAVAILABLE) && len(refusal.GetFieldViolations()) == 0
}
