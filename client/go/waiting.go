package sightline

import (
	"errors"
	"fmt"
	"math"

	"google.golang.org/protobuf/proto"

	v1 "sightline.dev/go/sightline/v1"
)

const (
	mostWaiting = 4096
	mostParts   = 8 // of what is folded: with and without rotation, velocity and angular velocity
)

// ErrQueueFull is the error of a tick that was not taken, because so many wait for a daemon.
var ErrQueueFull = errors.New("too many ticks wait for a daemon")

type placeOf struct {
	position        []float64
	rotation        []float32 // empty: it stays as it is
	velocity        []float32 // empty: the daemon derives it
	angularVelocity []float32 // empty: the daemon derives it
}

// entry is a tick that is kept whole, or several in one that only say where things are.
type entry struct {
	kept       *v1.Tick
	sequence   uint64
	timeS, dtS float64
	hasDt      bool       // some tick said its dt_s
	folded     []*v1.Tick // the first mostParts
	places     map[uint64]placeOf
	ids        []uint64           // the keys of places, in the order of their first tick
	observed   *v1.ObservedCamera // of the newest tick
	suggested  *v1.ObservedCamera // what the player sees instead of the daemon's camera
}

// part is elements n*i to n*(i+1), or none of an empty list.
func part[T any](values []T, n, i int) []T {
	if len(values) == 0 {
		return nil
	}
	return values[n*i : n*(i+1)]
}

func (e *entry) fold(tick *v1.Tick, dtS float64) {
	e.sequence, e.timeS, e.observed = tick.Sequence, tick.TimeS, tick.ObservedCamera
	e.dtS += dtS
	e.hasDt = e.hasDt || tick.DtS != nil
	if len(e.folded) < mostParts {
		e.folded = append(e.folded, tick)
	}
	moved := tick.GetTransforms()
	for i, id := range moved.GetIds() {
		before, known := e.places[id]
		if !known {
			e.ids = append(e.ids, id)
		}
		next := placeOf{part(moved.Positions, 3, i), part(moved.Rotations, 4, i), part(moved.Velocities, 3, i), part(moved.AngularVelocities, 3, i)}
		if next.rotation == nil {
			next.rotation = before.rotation
		}
		e.places[id] = next
	}
}

func (e *entry) ticks() []*v1.Tick {
	ticks := []*v1.Tick{e.kept}
	if e.kept == nil {
		ticks = e.parts()
	}
	last := ticks[len(ticks)-1]
	if last.ObservedCamera == nil {
		last.ObservedCamera = e.observed
	}
	if last.ObservedCamera == nil {
		last.ObservedCamera = e.suggested
	}
	return ticks
}

// parts are several ticks where need be: a message has rotations for all of its instances or for none, and so with
// velocities and angular velocities. Each part takes the number of a tick. Where there are fewer ticks than parts, the
// ticks go as they came.
func (e *entry) parts() []*v1.Tick {
	var parts []*v1.Tick
	kinds := map[[3]bool]*v1.Tick{}
	for _, id := range e.ids {
		place := e.places[id]
		kind := [3]bool{place.rotation != nil, place.velocity != nil, place.angularVelocity != nil}
		if kinds[kind] == nil {
			kinds[kind] = &v1.Tick{Transforms: &v1.Transforms{}}
			parts = append(parts, kinds[kind])
		}
		moved := kinds[kind].Transforms
		moved.Ids = append(moved.Ids, id)
		moved.Positions = append(moved.Positions, place.position...)
		moved.Rotations = append(moved.Rotations, place.rotation...)
		moved.Velocities = append(moved.Velocities, place.velocity...)
		moved.AngularVelocities = append(moved.AngularVelocities, place.angularVelocity...)
	}
	if len(parts) > len(e.folded) {
		return e.folded
	}
	if parts == nil {
		parts = []*v1.Tick{{}}
	}
	for i, tick := range parts {
		tick.Sequence, tick.TimeS = e.sequence-uint64(len(parts)-1-i), e.timeS
		if e.hasDt {
			tick.DtS = proto.Float64(0)
		}
	}
	if e.hasDt {
		parts[0].DtS = proto.Float64(e.dtS)
	}
	return parts
}

// waitingTicks holds ticks in their order. Those that carry only time and places, and perhaps an observed camera that is no cut, fold into
// one: the newest place counts for each id. Every other tick is kept whole, so that a refusal hits it alone; mostWaiting of them may wait.
type waitingTicks struct {
	entries []*entry
	timeS   *float64 // of the newest tick
}

// add takes a tick with its number.
func (w *waitingTicks) add(tick *v1.Tick) error {
	dtS := tick.GetDtS()
	if tick.DtS == nil && w.timeS != nil {
		dtS = tick.TimeS - *w.timeS
	}
	plain := w.isPlain(tick)
	if last := w.last(); !plain || last == nil || last.kept != nil {
		if len(w.entries) >= mostWaiting {
			return fmt.Errorf("%w: %d", ErrQueueFull, mostWaiting)
		}
		next := &entry{kept: tick}
		if plain {
			next = &entry{places: map[uint64]placeOf{}}
		}
		w.entries = append(w.entries, next)
	}
	if plain {
		w.last().fold(tick, dtS)
	}
	w.last().suggested = nil
	w.timeS = proto.Float64(tick.TimeS)
	return nil
}

func (w *waitingTicks) last() *entry {
	if len(w.entries) == 0 {
		return nil
	}
	return w.entries[len(w.entries)-1]
}

// suggest gives the newest tick an observed camera, if that tick waits and has none.
func (w *waitingTicks) suggest(observed *v1.ObservedCamera) {
	if last := w.last(); last != nil {
		last.suggested = observed
	}
}

// take returns the ticks to send next, each of which gets an answer.
func (w *waitingTicks) take() []*v1.Tick {
	first := w.entries[0]
	w.entries = w.entries[1:]
	return first.ticks()
}

// isPlain says whether a tick may be folded: only one that a daemon is likely to take.
func (w *waitingTicks) isPlain(tick *v1.Tick) bool {
	if tick.GetObservedCamera().GetCut() || !areFinite([]float64{tick.TimeS, tick.GetDtS()}) || tick.GetDtS() < 0 {
		return false
	}
	if w.timeS != nil && tick.TimeS < *w.timeS {
		return false
	}
	if !isWhole(tick.GetTransforms()) {
		return false
	}
	rest := proto.Clone(tick).(*v1.Tick)
	rest.Sequence, rest.TimeS, rest.DtS, rest.Transforms, rest.ObservedCamera = 0, 0, nil, nil, nil
	return proto.Size(rest) == 0
}

// isWhole says whether all numbers are there and finite, and no id comes twice.
func isWhole(moved *v1.Transforms) bool {
	n := len(moved.GetIds())
	if len(moved.GetPositions()) != 3*n || !isNoneOr(4*n, moved.GetRotations()) {
		return false
	}
	if !isNoneOr(3*n, moved.GetVelocities()) || !isNoneOr(3*n, moved.GetAngularVelocities()) {
		return false
	}
	ids := map[uint64]bool{}
	for _, id := range moved.GetIds() {
		ids[id] = true
	}
	return len(ids) == n && areFinite(moved.GetPositions()) && areFinite(moved.GetRotations()) &&
		areFinite(moved.GetVelocities()) && areFinite(moved.GetAngularVelocities())
}

func isNoneOr(count int, values []float32) bool {
	return len(values) == 0 || len(values) == count
}

func areFinite[T float32 | float64](values []T) bool {
	for _, value := range values {
		if math.IsNaN(float64(value)) || math.IsInf(float64(value), 0) {
			return false
		}
	}
	return true
}
