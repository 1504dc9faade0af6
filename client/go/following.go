package sightline

import (
	"math"
	"slices"

	v1 "sightline.dev/go/sightline/v1"
)

const (
	carryS      = 0.1 // time constant with which the motion relative to the targets dies away
	recentSteps = 5
)

// Drawn holds positions by id that are newer than the newest tick.
type Drawn map[uint64]Vector

type weighted struct {
	id     uint64
	weight float64
}

// targetPlaces follows the positions of the instances and the list of targets.
type targetPlaces struct {
	positions map[uint64]Vector
	weights   []weighted
}

func newTargetPlaces(opening *v1.OpenSession) *targetPlaces {
	p := &targetPlaces{positions: map[uint64]Vector{}}
	p.add(opening.GetInstances())
	p.choose(opening.GetTargets())
	return p
}

func (p *targetPlaces) shift(by Vector) {
	for id, position := range p.positions {
		p.positions[id] = position.plus(by)
	}
}

func (p *targetPlaces) apply(tick *v1.Tick) {
	for _, id := range tick.GetDelta().GetRemovedIds() {
		delete(p.positions, id)
	}
	p.add(tick.GetDelta().GetAddedInstances())
	places := tick.GetTransforms().GetPositions()
	for i, id := range tick.GetTransforms().GetIds() {
		if len(places) < 3*i+3 {
			break
		}
		if place := Vector(places[3*i : 3*i+3]); place.isFinite() {
			p.positions[id] = place
		}
	}
	if tick.Targets != nil {
		p.choose(tick.Targets.GetTargets())
	}
}

func (p *targetPlaces) add(instances []*v1.NewInstance) {
	for _, added := range instances {
		p.positions[added.GetId()] = read(added.GetPose().GetPosition())
	}
}

func (p *targetPlaces) choose(targets []*v1.Target) {
	p.weights = nil
	for _, target := range targets {
		weight := 1.0
		if target.Weight != nil {
			weight = *target.Weight
		}
		p.weights = append(p.weights, weighted{target.GetId(), weight})
	}
}

// counted are the targets that make up the centre.
func (p *targetPlaces) counted() []weighted {
	var counted []weighted
	for _, target := range p.weights {
		if _, known := p.positions[target.id]; known && target.weight > 0 {
			counted = append(counted, target)
		}
	}
	return counted
}

func (p *targetPlaces) position(id uint64, drawn Drawn) *Vector {
	if place, ok := drawn[id]; ok {
		return &place
	}
	if place, ok := p.positions[id]; ok {
		return &place
	}
	return nil
}

// centre is the weighted mean of the targets; nil: there is none whose position is known.
func (p *targetPlaces) centre(drawn Drawn) *Vector {
	total, mean := 0.0, Vector{}
	for _, target := range p.counted() {
		total += target.weight
		mean = mean.plus(p.position(target.id, drawn).times(target.weight))
	}
	if total == 0 {
		return nil
	}
	mean = mean.times(1 / total)
	return &mean
}

// follower keeps the camera's place relative to the targets' centre. Its motion relative to them dies away. It turns no more.
type follower struct {
	offset, velocity Vector
	sinceS           float64
}

func (f *follower) at(timeS float64, centre Vector) Vector {
	carried := carryS * (1 - math.Exp(-max(timeS-f.sinceS, 0)/carryS))
	return centre.plus(f.offset).plus(f.velocity.times(carried))
}

// recentMotion gives the velocity of a point from its last positions. A single jump does not count.
type recentMotion struct {
	started    bool
	timeS      float64
	position   Vector
	velocities []Vector
}

func (m *recentMotion) add(timeS float64, position Vector) {
	if m.started && timeS <= m.timeS {
		return
	}
	if m.started {
		m.velocities = append(m.velocities, position.minus(m.position).times(1/(timeS-m.timeS)))
		m.velocities = m.velocities[max(len(m.velocities)-recentSteps, 0):]
	}
	m.started, m.timeS, m.position = true, timeS, position
}

// velocity is the mean of the last steps without the fastest.
func (m *recentMotion) velocity() Vector {
	slower := slices.Clone(m.velocities)
	slices.SortStableFunc(slower, func(a, b Vector) int {
		return int(math.Copysign(1, a.length()-b.length()))
	})
	mean := Vector{}
	for i := 0; i+1 < len(slower); i++ {
		mean = mean.plus(slower[i].times(1 / float64(len(slower)-1)))
	}
	return mean
}
