// Moves two people behind a pillar, and prints where the camera goes: example [ADDRESS].
package main

import (
	"context"
	"fmt"
	"log"
	"math"
	"os"

	sightline "sightline.dev/go"
	v1 "sightline.dev/go/sightline/v1"
)

const anna, ben, pillar = 1, 2, 3

// Where Anna and Ben are, in metres; +Y is up.
func positions(timeS float64) *v1.Transforms {
	x := 3 * math.Sin(timeS)
	moved := &v1.Transforms{}
	sightline.Move(moved, anna, x-0.6, 0.9, 0)
	sightline.Move(moved, ben, x+0.6, 0.9, 0)
	return moved
}

func main() {
	address := "127.0.0.1:50151"
	if len(os.Args) > 1 {
		address = os.Args[1]
	}
	ctx, person := context.Background(), sightline.Capsule(0.3, 1.8)
	camera, err := sightline.Open(ctx, []string{address}, &v1.OpenSession{
		Instances: []*v1.NewInstance{
			sightline.Instance(anna, person, sightline.Vec(-0.6, 0.9, 0)),
			sightline.Instance(ben, person, sightline.Vec(0.6, 0.9, 0)),
			sightline.Instance(pillar, sightline.Box(1, 4, 1), sightline.Vec(0, 2, 2)),
		},
		Targets: []*v1.Target{{Id: anna}, {Id: ben}},
		Camera:  &v1.Pose3{Position: sightline.Vec(0, 1.6, 6)},
	}, sightline.Options{})
	if err != nil {
		log.Fatal(err)
	}
	for frame := range 300 {
		timeS := float64(frame) / 60
		reply, err := camera.Tick(ctx, &v1.Tick{TimeS: timeS, Transforms: positions(timeS)})
		if err != nil {
			log.Fatal(err)
		}
		p := reply.GetPose().GetPosition()
		fmt.Printf("%.2f s  camera (%.2f, %.2f, %.2f)  visible %.0f%% %.0f%%\n", timeS, p.GetX(), p.GetY(), p.GetZ(),
			100*reply.GetTargets()[0].GetVisibleShare(), 100*reply.GetTargets()[1].GetVisibleShare())
	}
	if err := camera.Close(ctx); err != nil {
		log.Fatal(err)
	}
}
