// Package sightline steers a camera that keeps several moving targets in view, by a Sightline daemon.
//
// A Camera is a session. Tick sends what has changed and returns where the camera goes. Messages are those of the package
// sightline.dev/go/sightline/v1, whose comments describe every field.
package sightline

import (
	"context"
	"crypto/tls"
	"errors"
	"math/rand/v2"
	"os"
	"time"

	"google.golang.org/protobuf/proto"

	v1 "sightline.dev/go/sightline/v1"
)

const (
	longestPause  = time.Second
	longestResume = 2 * time.Second // a daemon resumes a session at once, or not at all
)

// Options say how a camera reaches its daemons and what it does when one is lost. A zero time is the default.
type Options struct {
	GiveUpAfter  time.Duration       // how long a tick waits for a daemon that takes the session over; negative: not at all. Default: 30 s
	ReplyTimeout time.Duration       // a daemon that answers nothing for so long is taken for lost. Default: 5 s
	OpenTimeout  time.Duration       // the same for an upload, and for the opening, for which the daemon loads the scene. Default: 30 s
	Scene        []byte              // the client's own scene file (.glb, or .gltf without other files): each daemon gets it, and its hash goes into OpenSession.scene
	SceneFile    string              // the same by its path
	Uploads      [][]byte            // files that the opening or a tick names by their hashes; a daemon that does not have one gets it
	OnResync     func(reason string) // called by Tick after the session was opened again
	TLS          *tls.Config         // encrypts TCP, and can show the daemon a certificate; nil: TCP is not encrypted
	Token        string              // shows the daemon who calls; needs TLS or a unix socket
}

// Camera is a session that keeps targets in view. When the stream breaks, the next tick goes on with the session in a new stream: the daemon
// keeps it for a while (its flag --resume-grace-s), and the replies are those of an unbroken stream. When the daemon does not keep it, goes
// away, or says Drain, the next tick opens the session again, in the daemon that answers then, and returns its reply: at the camera's last
// pose, with the scene, targets, settings, limits and lens as they were. It must not be used by several goroutines at once.
type Camera struct {
	addresses []string
	address   int
	options   Options
	uploads   [][]byte // the client's own scene comes first
	snapshot  *snapshot
	stream    *stream
	opened    *v1.SessionOpened
	sequence  uint64
	resyncs   int
	resumes   int
	reopened  bool   // while the present tick waited for its answer
	token     []byte // of the session in the daemon at `address`, also while it is lost; empty: it cannot be resumed
	answered  uint64 // the newest tick of this session that was answered
}

// Open opens a session with the first of the addresses ("host:port" or "unix:/path") that answers. The error is a *Failed, that of ctx, or that
// of reading Options.SceneFile.
func Open(ctx context.Context, addresses []string, opening *v1.OpenSession, options Options) (*Camera, error) {
	setDefault(&options.GiveUpAfter, 30*time.Second)
	setDefault(&options.ReplyTimeout, 5*time.Second)
	setDefault(&options.OpenTimeout, 30*time.Second)
	err := options.readScene()
	if err != nil {
		return nil, err
	}
	c := &Camera{addresses: addresses, options: options, uploads: options.Uploads, snapshot: newSnapshot(opening)}
	if options.Scene != nil {
		c.uploads = append([][]byte{options.Scene}, options.Uploads...)
	}
	for range addresses {
		if err = c.openStream(ctx); err == nil {
			return c, nil
		}
		c.leave()
		if !isLost(err, true) {
			break
		}
	}
	return nil, err
}

func (o *Options) readScene() (err error) {
	if o.SceneFile != "" {
		o.Scene, err = os.ReadFile(o.SceneFile)
		o.SceneFile = ""
	}
	return err
}

func setDefault(value *time.Duration, standard time.Duration) {
	if *value == 0 {
		*value = standard
	}
}

// Opened is what the daemon said when it opened the session, the last time that one did.
func (c *Camera) Opened() *v1.SessionOpened { return c.opened }

// Resyncs counts how many times the session was opened again, in another daemon or in the same one.
func (c *Camera) Resyncs() int { return c.resyncs }

// Resumes counts how many times it went on in another stream without that.
func (c *Camera) Resumes() int { return c.resumes }

// Tick sends what has changed, and returns where the camera goes. The camera numbers ticks whose Sequence is 0. A tick that
// StepControl merges into the next one gets no reply and is an error. The error is a *Refused, a *Failed, or that of ctx; after the last one,
// the session goes on with the next tick in a new stream.
func (c *Camera) Tick(ctx context.Context, message *v1.Tick) (*v1.CameraReply, error) {
	if message.GetStepControl().GetMergeIntoNext() {
		return nil, errors.New("step_control.merge_into_next: a camera waits for a reply to each tick")
	}
	tick := proto.Clone(message).(*v1.Tick)
	if tick.Sequence == 0 {
		tick.Sequence = c.sequence + 1
	}
	c.sequence = max(c.sequence, tick.Sequence)
	answer, err := c.askUntilAnswered(ctx, tick)
	if err != nil {
		return nil, err
	}
	if refusal := answer.GetTickError(); refusal != nil {
		if wasApplied(refusal) {
			c.snapshot.apply(tick)
		}
		return nil, &Refused{TickError: refusal}
	}
	c.snapshot.apply(tick)
	c.snapshot.takeReply(answer.GetCamera())
	return answer.GetCamera(), nil
}

// Close ends the session. The error is a *Failed if the session was lost meanwhile.
func (c *Camera) Close(ctx context.Context) error {
	if c.stream == nil {
		return nil
	}
	last := c.stream
	c.stream = nil
	return last.finish(ctx, c.options.ReplyTimeout)
}

func (c *Camera) askUntilAnswered(ctx context.Context, tick *v1.Tick) (*v1.ControlResponse, error) {
	giveUp := time.Now().Add(c.options.GiveUpAfter)
	reason := ""
	c.reopened = false
	for pause := time.Duration(0); ; pause = longer(pause) {
		if err := sleep(ctx, pause); err != nil {
			return nil, err
		}
		answer, why, err := c.tryToAsk(ctx, tick)
		if reason == "" {
			reason = why
		}
		if err == nil {
			c.answered = tick.Sequence
			c.count(reason)
			return answer, nil
		}
		opening := c.stream == nil
		c.leave()
		if !isLost(err, opening) || !time.Now().Before(giveUp) {
			return nil, err
		}
		if reason == "" {
			reason = err.Error()
		}
	}
}

func (c *Camera) count(reason string) {
	if !c.reopened {
		return
	}
	if reason == "" {
		reason = "the former tick lost the session"
	}
	c.resyncs++
	if c.options.OnResync != nil {
		c.options.OnResync(reason)
	}
}

// tryToAsk returns the answer, and the reason why the former stream was left, if it was.
func (c *Camera) tryToAsk(ctx context.Context, tick *v1.Tick) (answer *v1.ControlResponse, reason string, err error) {
	if c.stream != nil {
		if drained := c.stream.drained.Load(); drained != nil {
			reason = *drained
			c.leave()
		}
	}
	taken := false
	if c.stream == nil && len(c.token) > 0 {
		if taken, err = c.resume(ctx, tick.Sequence); err != nil {
			return nil, reason, err
		}
	}
	if c.stream == nil {
		if err = c.openStream(ctx); err != nil {
			return nil, reason, err
		}
		c.reopened = true
		c.tellPast(tick)
	}
	if !taken {
		c.stream.send(&v1.ControlRequest{Message: &v1.ControlRequest_Tick{Tick: tick}})
	}
	answer, err = c.waitForAnswer(ctx, tick)
	return answer, reason, err
}

// resume goes on with the lost session, if the daemon keeps it. taken: the daemon has the tick already, and its answer follows. Without a
// stream afterwards, and without an error, a new session must be opened.
func (c *Camera) resume(ctx context.Context, sequence uint64) (taken bool, err error) {
	next, opened, err := c.tryToResume(ctx)
	if ctx.Err() != nil {
		return false, ctx.Err()
	}
	if err == nil {
		newest := opened.GetNewestSequence()
		if newest == sequence || newest == c.answered {
			c.stream = next
			c.resumes++
			return newest == sequence, nil
		}
		_ = next.finish(ctx, c.options.ReplyTimeout) // the session lacks ticks that a former stream lost
	} else if isLost(err, true) {
		if len(c.addresses) == 1 {
			return false, err
		}
		c.nextAddress()
	}
	c.token = nil
	return false, nil
}

func (c *Camera) tryToResume(ctx context.Context) (*stream, *v1.SessionOpened, error) {
	next, err := openStream(c.addresses[c.address], &c.options)
	if err != nil {
		return nil, nil, err
	}
	request := &v1.ResumeSession{Token: c.token, AnsweredSequence: c.answered}
	next.send(&v1.ControlRequest{Message: &v1.ControlRequest_Resume{Resume: request}})
	opened, err := next.opened(ctx, min(c.options.ReplyTimeout, longestResume))
	return next, opened, err
}

// openStream leaves no stream behind when it fails.
func (c *Camera) openStream(ctx context.Context) error {
	first := 0
	if c.options.Scene != nil && c.snapshot.first.GetScene().GetHash() == "" {
		first = 1 // the opening needs its hash, which comes with the upload
	}
	opened, err := c.openSession(ctx, c.uploads[:first])
	if err != nil && lacksScene(err) && len(c.uploads) > 0 {
		opened, err = c.openSession(ctx, c.uploads)
	}
	c.stream = opened
	return err
}

func (c *Camera) openSession(ctx context.Context, uploads [][]byte) (*stream, error) {
	ctx, cancel := context.WithTimeout(ctx, c.options.OpenTimeout*time.Duration(len(uploads)+1))
	defer cancel()
	if err := c.upload(ctx, uploads); err != nil {
		return nil, err
	}
	next, err := openStream(c.addresses[c.address], &c.options)
	if err != nil {
		return nil, err
	}
	opening := c.snapshot.opening()
	opening.Resumable = true
	next.send(&v1.ControlRequest{Message: &v1.ControlRequest_Open{Open: opening}})
	opened, err := next.opened(ctx, c.options.OpenTimeout)
	if err != nil {
		return nil, err
	}
	c.opened, c.token, c.answered = opened, opened.GetResumeToken(), 0
	return next, nil
}

// upload uses a stream that opens no session, since the daemon does not wait long for an opening.
func (c *Camera) upload(ctx context.Context, scenes [][]byte) error {
	if len(scenes) == 0 {
		return nil
	}
	apart, err := openStream(c.addresses[c.address], &c.options)
	if err != nil {
		return err
	}
	defer apart.cutOff()
	for i, scene := range scenes {
		hash, err := apart.upload(ctx, scene)
		if err != nil {
			return err
		}
		if i == 0 && c.options.Scene != nil {
			c.snapshot.useScene(hash)
		}
	}
	return nil
}

// tellPast tells a new session what happened before the tick.
func (c *Camera) tellPast(tick *v1.Tick) {
	ticks := c.snapshot.ticks(tick.Sequence)
	revision := c.opened.GetMirrorRevision()
	for _, summary := range ticks {
		if summary.Delta != nil {
			revision++
		}
		c.stream.send(&v1.ControlRequest{Message: &v1.ControlRequest_Tick{Tick: summary}})
	}
	if tick.Delta != nil && tick.Delta.BaseRevision != nil {
		tick.Delta.BaseRevision = proto.Uint64(revision)
	}
}

func (c *Camera) waitForAnswer(ctx context.Context, tick *v1.Tick) (*v1.ControlResponse, error) {
	for {
		answer, err := c.stream.receive(ctx, c.options.ReplyTimeout)
		if err != nil {
			return nil, err
		}
		if answer.GetTickError() != nil || (answer.GetCamera() != nil && answer.GetCamera().GetSequence() == tick.Sequence) {
			return answer, nil
		}
	}
}

// leave gives the stream up. The next one goes to the next address, unless the session can be resumed.
func (c *Camera) leave() {
	if c.stream != nil {
		if c.stream.drained.Load() != nil {
			c.token = nil
		}
		c.stream.cutOff()
		c.stream = nil
	}
	if len(c.token) == 0 {
		c.nextAddress()
	}
}

func (c *Camera) nextAddress() { c.address = (c.address + 1) % len(c.addresses) }

// longer is the time to wait before the next attempt.
func longer(pause time.Duration) time.Duration {
	return min(max(2*pause, 50*time.Millisecond), longestPause)
}

// sleep waits, a little less each time at random, so that the cameras of a lost daemon do not all come at once.
func sleep(ctx context.Context, pause time.Duration) error {
	timer := time.NewTimer(time.Duration(float64(pause) * (0.5 + rand.Float64()/2)))
	defer timer.Stop()
	select {
	case <-timer.C:
		return nil
	case <-ctx.Done():
		return ctx.Err()
	}
}
