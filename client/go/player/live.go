package main

import (
	"encoding/json"
	"errors"
	"log"
	"strconv"
	"time"

	"google.golang.org/protobuf/encoding/protojson"
	"google.golang.org/protobuf/proto"

	sightline "sightline.dev/go"
	v1 "sightline.dev/go/sightline/v1"
)

// live runs the commands of tests/live, for a PoseSampler and a LiveCamera.
type live struct {
	sampler *sightline.PoseSampler
	camera  *sightline.LiveCamera
}

type liveCommand struct {
	New       json.RawMessage `json:"sampler_new"`
	Add       json.RawMessage `json:"sampler_add"`
	Shift     []float64       `json:"sampler_shift"`
	At        *samplerAt      `json:"sampler_at"`
	Open      json.RawMessage `json:"live_open"`
	Tick      json.RawMessage `json:"live_tick"`
	Close     json.RawMessage `json:"live_close"`
	Address   string
	SceneFile string  `json:"scene_file"`
	WaitInSec float64 `json:"wait_s"`
}

type samplerAt struct {
	TimeS  float64 `json:"time_s"`
	Target []float64
}

func parse[M proto.Message](text json.RawMessage, into M) M {
	if err := protojson.Unmarshal(text, into); err != nil {
		log.Fatal(err)
	}
	return into
}

func (l *live) run(line []byte) (answer object, known bool) {
	var c liveCommand
	if err := json.Unmarshal(line, &c); err != nil {
		log.Fatal(err)
	}
	switch {
	case c.New != nil:
		l.sampler = &sightline.PoseSampler{}
		return object{"sampler": object{}}, true
	case c.Add != nil:
		return object{"taken": l.sampler.Add(parse(c.Add, &v1.CameraReply{}))}, true
	case c.Shift != nil:
		l.sampler.Shift(sightline.Vector(c.Shift))
		return object{"sampler": object{}}, true
	case c.At != nil:
		return l.sample(*c.At), true
	case c.Open != nil:
		wait := time.Duration(c.WaitInSec * float64(time.Second))
		if wait == 0 {
			wait = -1
		}
		l.camera = sightline.OpenLive([]string{c.Address}, parse(c.Open, &v1.OpenSession{}), sightline.LiveOptions{Options: sightline.Options{SceneFile: c.SceneFile}, Wait: wait})
		return object{"live": object{}}, true
	case c.Tick != nil:
		return l.tick(parse(c.Tick, &v1.Tick{})), true
	case c.Close != nil:
		began := time.Now()
		l.camera.Close()
		return object{"live_closed": object{"took_s": time.Since(began).Seconds(), "resyncs": l.camera.Resyncs(), "resumes": l.camera.Resumes()}}, true
	}
	return nil, false
}

func (l *live) sample(at samplerAt) object {
	var target *sightline.Vector
	if len(at.Target) == 3 {
		place := sightline.Vector(at.Target)
		target = &place
	}
	shown, ok := l.sampler.Sample(at.TimeS, target)
	if !ok {
		return object{"sample": nil}
	}
	cut := 0.0
	if shown.Cut {
		cut = 1
	}
	return object{"sample": append(append(shown.Position[:], shown.Rotation[:]...), shown.FieldOfView, cut)}
}

func (l *live) tick(message *v1.Tick) object {
	began := time.Now()
	view, err := l.camera.Tick(message)
	took := time.Since(began).Seconds()
	var failed *sightline.Failed
	if errors.As(err, &failed) {
		return object{"error": codeName(failed.Code.String())}
	}
	if errors.Is(err, sightline.ErrQueueFull) {
		return object{"error": "QUEUE_FULL"}
	}
	if err != nil {
		log.Fatal(err)
	}
	refusals, codes := []uint64{}, []int32{}
	for _, refusal := range view.Refusals {
		refusals = append(refusals, refusal.GetSequence())
		codes = append(codes, int32(refusal.GetCode()))
	}
	return object{"view": object{
		"position": view.Position, "rotation": view.Rotation, "field_of_view": view.FieldOfView, "cut": view.Cut, "age_s": view.AgeS,
		"source": view.Source, "sequence": view.Sequence, "reply": view.Reply.GetSequence(), "hash": strconv.FormatUint(view.Reply.GetMirrorHash(), 10),
		"refusals": refusals, "refusal_codes": codes, "trouble": view.Trouble != nil, "took_s": took}}
}
