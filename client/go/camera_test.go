package sightline

import (
	"context"
	"errors"
	"math"
	"os"
	"os/exec"
	"path/filepath"
	"slices"
	"strings"
	"syscall"
	"testing"
	"time"

	"google.golang.org/grpc/codes"

	v1 "sightline.dev/go/sightline/v1"
)

const hero, pillar = 1, 3

// A daemon of the test's own, which keeps its address when it is started again. The environment variable SIGHTLINED names the program.
type daemon struct {
	t       *testing.T
	command *exec.Cmd
	address string
}

func startDaemon(t *testing.T) *daemon {
	t.Helper()
	if os.Getenv("SIGHTLINED") == "" {
		t.Skip("SIGHTLINED names no daemon")
	}
	d := &daemon{t: t, address: "127.0.0.1:0"}
	d.start()
	t.Cleanup(func() { d.stop(syscall.SIGKILL) })
	return d
}

func (d *daemon) start() {
	ready := filepath.Join(d.t.TempDir(), "ready")
	d.command = exec.Command(os.Getenv("SIGHTLINED"), "--sampler", "embree", "--log-level", "error", "--listen", d.address, "--ready-file", ready)
	if err := d.command.Start(); err != nil {
		d.t.Fatal(err)
	}
	for range 6000 {
		if text, err := os.ReadFile(ready); err == nil {
			d.address = strings.Fields(string(text))[0]
			return
		}
		time.Sleep(10 * time.Millisecond)
	}
	d.t.Fatal("the daemon did not start")
}

func (d *daemon) stop(signal syscall.Signal) {
	_ = d.command.Process.Signal(signal)
	_ = d.command.Wait()
}

func opening() *v1.OpenSession {
	return &v1.OpenSession{
		Instances: []*v1.NewInstance{Instance(hero, Capsule(0.3, 1.8), Vec(0, 0.9, 0)), Instance(pillar, Box(1, 4, 1), Vec(0, 2, 2))},
		Targets:   []*v1.Target{{Id: hero}},
		Camera:    &v1.Pose3{Position: Vec(0, 1.6, 6)},
	}
}

func openCamera(t *testing.T, options Options, daemons ...*daemon) *Camera {
	t.Helper()
	var addresses []string
	for _, d := range daemons {
		addresses = append(addresses, d.address)
	}
	camera, err := Open(context.Background(), addresses, opening(), options)
	if err != nil {
		t.Fatal(err)
	}
	t.Cleanup(func() { _ = camera.Close(context.Background()) })
	return camera
}

func play(t *testing.T, camera *Camera, first, n int) []*v1.CameraReply {
	t.Helper()
	var replies []*v1.CameraReply
	for frame := first; frame < first+n; frame++ {
		moved := &v1.Transforms{}
		Move(moved, hero, math.Sin(float64(frame)/60), 0.9, 0)
		reply, err := camera.Tick(context.Background(), &v1.Tick{TimeS: float64(frame) / 60, Transforms: moved})
		if err != nil {
			t.Fatal(err)
		}
		replies = append(replies, reply)
	}
	return replies
}

func apart(a, b *v1.CameraReply) float64 {
	p, q := a.GetPose().GetPosition(), b.GetPose().GetPosition()
	return math.Hypot(math.Hypot(p.GetX()-q.GetX(), p.GetY()-q.GetY()), p.GetZ()-q.GetZ())
}

func TestTheCameraMovesUntilItSeesWhatAPillarHides(t *testing.T) {
	camera := openCamera(t, Options{}, startDaemon(t))
	replies := play(t, camera, 0, 120)
	if first := replies[0].GetTargets()[0].GetVisibleShare(); first != 0 {
		t.Errorf("visible at first: %v", first)
	}
	if last := replies[119]; last.GetSequence() != 120 || last.GetTargets()[0].GetVisibleShare() != 1 {
		t.Errorf("last reply: %v", last)
	}
}

func TestErrorsNameTheField(t *testing.T) {
	d := startDaemon(t)
	camera := openCamera(t, Options{}, d)
	moved := &v1.Transforms{}
	Move(moved, 99, 0, 0, 0)
	_, err := camera.Tick(context.Background(), &v1.Tick{Transforms: moved})
	var refused *Refused
	if !errors.As(err, &refused) || refused.TickError.GetFieldViolations()[0].GetField() != "tick.transforms.ids[0]" {
		t.Errorf("got %v", err)
	}
	wrong := opening()
	wrong.Targets[0].Id = 99
	_, err = Open(context.Background(), []string{d.address}, wrong, Options{})
	var failed *Failed
	if !errors.As(err, &failed) || failed.Code != codes.NotFound || failed.Violations[0].GetField() != "open.targets[0].id" {
		t.Errorf("got %v", err)
	}
	_, err = Open(context.Background(), []string{"127.0.0.1:1"}, opening(), Options{})
	if !errors.As(err, &failed) || failed.Code != codes.Unavailable {
		t.Errorf("got %v", err)
	}
}

func TestASceneFileThatIsMissingIsAnError(t *testing.T) {
	options := Options{SceneFile: "no/such.glb"}
	if _, err := Open(context.Background(), []string{"127.0.0.1:1"}, opening(), options); !errors.Is(err, os.ErrNotExist) {
		t.Errorf("got %v", err)
	}
	camera := OpenLive([]string{"127.0.0.1:1"}, opening(), LiveOptions{Options: options})
	if _, err := camera.Tick(&v1.Tick{}); !errors.Is(err, os.ErrNotExist) {
		t.Errorf("got %v", err)
	}
	camera.Close()
}

func TestTheSessionGoesOnInTheDaemonAtTheNextAddress(t *testing.T) {
	first, second := startDaemon(t), startDaemon(t)
	var reasons []string
	camera := openCamera(t, Options{OnResync: func(reason string) { reasons = append(reasons, reason) }}, first, second)
	before := play(t, camera, 0, 30)
	first.stop(syscall.SIGTERM)
	after := play(t, camera, 30, 30)
	if after[29].GetSequence() != 60 || apart(before[29], after[0]) > 0.2 {
		t.Errorf("from %v to %v", before[29].GetPose(), after[0].GetPose())
	}
	if !slices.Equal(reasons, []string{"the server is stopping"}) || camera.Resyncs() != 1 {
		t.Errorf("got %v, %v resyncs", reasons, camera.Resyncs())
	}
}

func TestASessionWaitsForADaemonThatIsStartedAgain(t *testing.T) {
	d := startDaemon(t)
	camera := openCamera(t, Options{}, d)
	play(t, camera, 0, 10)
	d.stop(syscall.SIGKILL)
	started := make(chan bool)
	go func() {
		time.Sleep(500 * time.Millisecond)
		d.start()
		close(started)
	}()
	if last := play(t, camera, 10, 10)[9]; last.GetSequence() != 20 {
		t.Errorf("last reply: %v", last)
	}
	<-started
}

func TestADaemonThatHangsIsLeftAndACameraGivesUpInTime(t *testing.T) {
	first, second := startDaemon(t), startDaemon(t)
	camera := openCamera(t, Options{ReplyTimeout: 2 * time.Second, GiveUpAfter: -1}, first, second)
	if err := first.command.Process.Signal(syscall.SIGSTOP); err != nil {
		t.Fatal(err)
	}
	_, err := camera.Tick(context.Background(), &v1.Tick{})
	var failed *Failed
	if !errors.As(err, &failed) || failed.Code != codes.Unavailable || !strings.Contains(failed.Message, "nothing for 2s") {
		t.Errorf("got %v", err)
	}
	play(t, camera, 1, 1) // the next tick tries again
}

func TestACancelledTickReturnsAtOnce(t *testing.T) {
	d := startDaemon(t)
	camera := openCamera(t, Options{}, d)
	play(t, camera, 0, 5)
	d.stop(syscall.SIGKILL)
	ctx, cancel := context.WithTimeout(context.Background(), 200*time.Millisecond)
	defer cancel()
	if _, err := camera.Tick(ctx, &v1.Tick{TimeS: 1}); !errors.Is(err, context.DeadlineExceeded) {
		t.Errorf("got %v", err)
	}
}

func TestTheExampleIsShortAndMovesACamera(t *testing.T) {
	d := startDaemon(t)
	source, err := os.ReadFile("example/main.go")
	if err != nil || strings.Count(string(source), "\n") >= 60 {
		t.Errorf("the example is long, or missing: %v", err)
	}
	printed, err := exec.Command("go", "run", "./example", d.address).Output()
	if err != nil {
		t.Fatal(err)
	}
	lines := strings.Split(strings.TrimSpace(string(printed)), "\n")
	if both := slices.DeleteFunc(slices.Clone(lines), func(line string) bool { return !strings.HasSuffix(line, "100% 100%") }); len(lines) != 300 || len(both) < 150 {
		t.Errorf("%d lines, both targets visible in %d", len(lines), len(both))
	}
}
