package sightline

import (
	"context"
	"errors"
	"sync"
	"time"

	"google.golang.org/protobuf/proto"

	v1 "sightline.dev/go/sightline/v1"
)

// Between attempts, so that a daemon that is back is found soon.
const longestLivePause = 250 * time.Millisecond

// LiveOptions say how a LiveCamera reaches its daemons, and how long it waits. A zero time is the default. GiveUpAfter does not count, and
// the default of ReplyTimeout is 2 s: without an answer for so long, the stream is given up for a new one.
type LiveOptions struct {
	Options
	Wait          time.Duration // Tick waits at most so long for its answer; negative: not at all. Default: 0.1 s
	FallbackAfter time.Duration // without an answer for so long, the camera follows the targets by itself; more than the way to the daemon and back. Default: 0.3 s
	Blend         time.Duration // so long the way back takes, in game time. Default: 0.5 s
	CloseAfter    time.Duration // so long the last ticks may take. Default: 1 s
}

// LiveView is the camera to draw now.
type LiveView struct {
	Sample
	AgeS     float64 // game time since the tick that the newest reply covers; 0: this one
	Source   Source
	Sequence uint64          // number of the newest tick; the first is 1
	Reply    *v1.CameraReply // the newest one; nil: there is none so far
	Refusals []*v1.TickError // of ticks, since the former view; Sequence says which
	Trouble  error           // why no daemon answers; nil: one does
}

// LiveCamera is a session that keeps targets in view, for a game loop that must not wait. It opens at once; a goroutine reaches the daemon,
// for ever if need be. A daemon that can never accept the opening is an error, which Tick returns. One that is away is not. It must not be
// used by several goroutines at once.
type LiveCamera struct {
	// constant after the opening
	addresses []string
	opening   *v1.OpenSession
	options   LiveOptions
	ctx       context.Context // of the worker; it ends when the last ticks take too long
	cancel    context.CancelFunc
	stopping  chan struct{}
	stopped   chan struct{}

	mutex sync.Mutex // guards what follows
	// Closed and replaced when something has changed.
	changed      chan struct{}
	camera       *Camera
	display      *display
	waiting      waitingTicks
	sequence     uint64 // of the newest tick
	answered     uint64 // the newest one that was answered
	firstS       *float64
	silentSince  time.Time // counts while ticks are unanswered
	refusals     []*v1.TickError
	fatal        error
	trouble      error
	opened       *v1.SessionOpened
	resyncs      int
	resumes      int
	closedByGame bool
}

type streamName struct {
	sessionID string
	resumes   int
}

// OpenLive starts a session with the first of the addresses ("host:port" or "unix:/path") that answers. It returns at once.
func OpenLive(addresses []string, opening *v1.OpenSession, options LiveOptions) *LiveCamera {
	setDefault(&options.Wait, 100*time.Millisecond)
	setDefault(&options.FallbackAfter, 300*time.Millisecond)
	setDefault(&options.Blend, 500*time.Millisecond)
	setDefault(&options.CloseAfter, time.Second)
	setDefault(&options.ReplyTimeout, 2*time.Second)
	options.GiveUpAfter = -1
	opening = proto.Clone(opening).(*v1.OpenSession)
	fatal := options.readScene()
	ctx, cancel := context.WithCancel(context.Background())
	c := &LiveCamera{addresses: addresses, opening: opening, options: options, ctx: ctx, cancel: cancel, display: newDisplay(opening, options.Blend.Seconds()),
		fatal: fatal, stopping: make(chan struct{}), stopped: make(chan struct{}), changed: make(chan struct{})}
	if c.fatal != nil {
		close(c.stopped)
	} else {
		go c.work()
	}
	return c
}

// Opened is what the daemon said when it opened the session, the last time that one did; nil: none did so far.
func (c *LiveCamera) Opened() *v1.SessionOpened {
	c.mutex.Lock()
	defer c.mutex.Unlock()
	return c.opened
}

// Resyncs is as that of Camera.
func (c *LiveCamera) Resyncs() int {
	c.mutex.Lock()
	defer c.mutex.Unlock()
	return c.resyncs
}

// Resumes is as that of Camera.
func (c *LiveCamera) Resumes() int {
	c.mutex.Lock()
	defer c.mutex.Unlock()
	return c.resumes
}

// Tick tells the daemon what has changed, and returns the camera to draw. It waits for the answer at most LiveOptions.Wait, and not at all
// while an earlier tick is unanswered. The camera numbers ticks. The error is ErrQueueFull, a *Failed for an opening that no daemon accepts, or that of
// reading Options.SceneFile.
func (c *LiveCamera) Tick(message *v1.Tick) (*LiveView, error) {
	if message.GetStepControl().GetMergeIntoNext() {
		return nil, errors.New("step_control.merge_into_next: a camera waits for a reply to each tick")
	}
	if message.GetSequence() != 0 {
		return nil, errors.New("sequence: a LiveCamera numbers its ticks")
	}
	if !areFinite([]float64{message.GetTimeS()}) {
		return nil, errors.New("time_s: must be finite")
	}
	c.mutex.Lock()
	defer c.mutex.Unlock()
	idle := c.answered == c.sequence
	if err := c.take(proto.Clone(message).(*v1.Tick), idle); err != nil {
		return nil, err
	}
	countsFrom := c.sequence
	if idle {
		c.waitForAnswer()
		countsFrom++
	}
	if err := c.check(); err != nil {
		return nil, err
	}
	view := c.view(message.GetTimeS(), nil, countsFrom)
	if c.display.follower != nil {
		c.waiting.suggest(c.display.observed())
	}
	return view, nil
}

// Sample is the camera to draw between ticks, at a game time near the newest tick's. drawn: positions of targets at that time, by id.
func (c *LiveCamera) Sample(timeS float64, drawn Drawn) (*LiveView, error) {
	c.mutex.Lock()
	defer c.mutex.Unlock()
	if err := c.check(); err != nil {
		return nil, err
	}
	return c.view(timeS, drawn, c.sequence+1), nil
}

// Close ends the session. Ticks that wait are sent before, if a daemon takes them within LiveOptions.CloseAfter.
func (c *LiveCamera) Close() {
	c.mutex.Lock()
	if !c.closedByGame {
		c.closedByGame = true
		close(c.stopping)
	}
	c.mutex.Unlock()
	timer := time.AfterFunc(c.options.CloseAfter, c.cancel)
	<-c.stopped
	timer.Stop()
	c.cancel()
}

func (c *LiveCamera) check() error {
	if c.closedByGame {
		return errors.New("the camera is closed")
	}
	return c.fatal
}

func (c *LiveCamera) take(tick *v1.Tick, idle bool) error {
	if err := c.check(); err != nil {
		return err
	}
	tick.Sequence = c.sequence + 1
	if err := c.waiting.add(tick); err != nil {
		return err
	}
	c.display.takeTick(tick)
	if idle {
		c.silentSince = time.Now()
	}
	if c.firstS == nil {
		c.firstS = proto.Float64(tick.GetTimeS())
	}
	c.sequence = tick.Sequence
	c.notify()
	return nil
}

func (c *LiveCamera) notify() {
	close(c.changed)
	c.changed = make(chan struct{})
}

// waitForAnswer unlocks the mutex meanwhile.
func (c *LiveCamera) waitForAnswer() {
	timer := time.NewTimer(c.options.Wait)
	defer timer.Stop()
	for late := false; !late && c.answered < c.sequence && c.fatal == nil; {
		changed := c.changed
		c.mutex.Unlock()
		select {
		case <-changed:
		case <-timer.C:
			late = true
		}
		c.mutex.Lock()
	}
}

func (c *LiveCamera) view(timeS float64, drawn Drawn, countsFrom uint64) *LiveView {
	if c.answered != c.sequence && time.Since(c.silentSince) >= c.options.FallbackAfter {
		c.display.follow(countsFrom)
	}
	shown, source := c.display.show(timeS, drawn)
	reply := c.display.newest
	if source == SourcePredicted && reply.GetSequence() == c.sequence && reply != nil {
		source = SourceReply
	}
	coveredS := timeS
	if reply != nil {
		coveredS = reply.GetTimeS()
	} else if c.firstS != nil {
		coveredS = *c.firstS
	}
	view := &LiveView{shown, max(timeS-coveredS, 0), source, c.sequence, reply, c.refusals, c.trouble}
	c.refusals = nil
	return view
}

// On the worker's goroutine.

func (c *LiveCamera) work() {
	defer close(c.stopped)
	if !c.tryForEver(nil) {
		return
	}
	for ticks := c.next(); ticks != nil; ticks = c.next() {
		for _, tick := range ticks {
			if !c.tryForEver(tick) {
				return
			}
		}
	}
	_ = c.camera.Close(c.ctx) // the session is over in any case
}

// next waits for ticks. Nil: the camera was closed, and none is left.
func (c *LiveCamera) next() []*v1.Tick {
	c.mutex.Lock()
	defer c.mutex.Unlock()
	for len(c.waiting.entries) == 0 {
		changed := c.changed
		c.mutex.Unlock()
		stopping := false
		select {
		case <-changed:
		case <-c.stopping:
			stopping = true
		}
		c.mutex.Lock()
		if stopping && len(c.waiting.entries) == 0 {
			return nil
		}
	}
	return c.waiting.take()
}

// tryForEver opens the session if need be, and gets the answer to the tick. False: the camera was closed, or no daemon takes the opening.
func (c *LiveCamera) tryForEver(tick *v1.Tick) bool {
	for pause := time.Duration(0); ; pause = min(longer(pause), longestLivePause) {
		if pause > 0 && !c.sleep(pause) {
			return false
		}
		stream := c.streamName()
		reply, err := c.try(tick)
		var failed *Failed
		if tick != nil && c.streamName() != stream && errors.As(err, &failed) && !isLost(err, false) {
			err = failed.asRefusal(tick.GetSequence()) // it would end the call of the next stream too
		}
		var refused *Refused
		if err == nil || errors.As(err, &refused) {
			if tick != nil {
				c.answer(tick, reply, refused)
			}
			return true
		}
		if c.ctx.Err() != nil || (c.camera == nil && c.failForGood(err)) {
			return false
		}
		c.mutex.Lock()
		c.trouble = err
		c.mutex.Unlock()
	}
}

// streamName is another one after each opening and each resumption. A session that cannot be resumed goes on under another id.
func (c *LiveCamera) streamName() streamName {
	c.mutex.Lock()
	defer c.mutex.Unlock()
	return streamName{c.opened.GetSessionId(), c.resumes}
}

// sleep returns false when the camera was closed.
func (c *LiveCamera) sleep(pause time.Duration) bool {
	ctx, cancel := context.WithCancel(c.ctx)
	defer cancel()
	go func() {
		select {
		case <-c.stopping:
			cancel()
		case <-ctx.Done():
		}
	}()
	return sleep(ctx, pause) == nil
}

func (c *LiveCamera) try(tick *v1.Tick) (reply *v1.CameraReply, err error) {
	if c.camera == nil {
		opened, err := Open(c.ctx, c.addresses, c.opening, c.options.Options)
		if err != nil {
			return nil, err
		}
		c.camera = opened
	}
	if tick != nil {
		reply, err = c.camera.Tick(c.ctx, tick)
	}
	c.mutex.Lock()
	defer c.mutex.Unlock()
	c.opened, c.resyncs, c.resumes = c.camera.Opened(), c.camera.Resyncs(), c.camera.Resumes()
	return reply, err
}

// failForGood says whether no daemon can ever accept the opening.
func (c *LiveCamera) failForGood(err error) bool {
	if isLost(err, true) {
		return false
	}
	c.mutex.Lock()
	defer c.mutex.Unlock()
	c.fatal = err
	c.notify()
	return true
}

func (c *LiveCamera) answer(tick *v1.Tick, reply *v1.CameraReply, refused *Refused) {
	c.mutex.Lock()
	defer c.mutex.Unlock()
	c.answered, c.trouble, c.silentSince = tick.GetSequence(), nil, time.Now()
	if reply != nil {
		c.display.takeReply(reply)
	}
	if refused != nil && len(c.refusals) < mostWaiting {
		c.refusals = append(c.refusals, refused.TickError)
	}
	c.notify()
}
