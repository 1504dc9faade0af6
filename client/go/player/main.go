// Plays conformance sessions with the Go client. tests/conformance/README.md describes the protocol.
package main

import (
	"bufio"
	"context"
	"crypto/tls"
	"crypto/x509"
	"encoding/json"
	"errors"
	"fmt"
	"log"
	"os"
	"strings"

	"google.golang.org/protobuf/encoding/protojson"
	"google.golang.org/protobuf/proto"

	sightline "sightline.dev/go"
	v1 "sightline.dev/go/sightline/v1"
)

type command struct {
	Open, Tick json.RawMessage
	Address    string
	Uploads    []string
	Scene      string
	SceneFile  string `json:"scene_file"`
	Trust      map[string]string
}

type object = map[string]any

func asJSON(message proto.Message) json.RawMessage {
	text, err := protojson.Marshal(message)
	if err != nil {
		log.Fatal(err)
	}
	return text
}

func tlsConfig(trust map[string]string) *tls.Config {
	if trust["roots"] == "" {
		return nil
	}
	roots, err := os.ReadFile(trust["roots"])
	if err != nil {
		log.Fatal(err)
	}
	config := &tls.Config{RootCAs: x509.NewCertPool()}
	config.RootCAs.AppendCertsFromPEM(roots)
	if trust["certificate"] != "" {
		pair, err := tls.LoadX509KeyPair(trust["certificate"], trust["key"])
		if err != nil {
			log.Fatal(err)
		}
		config.Certificates = []tls.Certificate{pair}
	}
	return config
}

func open(c command) (*sightline.Camera, error) {
	request, options := &v1.OpenSession{}, sightline.Options{Token: c.Trust["token"], TLS: tlsConfig(c.Trust), SceneFile: c.SceneFile}
	if err := protojson.Unmarshal(c.Open, request); err != nil {
		return nil, err
	}
	if c.Scene != "" {
		scene, err := os.ReadFile(c.Scene)
		if err != nil {
			return nil, err
		}
		options.Scene = scene
	}
	for _, path := range c.Uploads {
		scene, err := os.ReadFile(path)
		if err != nil {
			return nil, err
		}
		options.Uploads = append(options.Uploads, scene)
	}
	return sightline.Open(context.Background(), []string{c.Address}, request, options)
}

func run(camera **sightline.Camera, c command) (object, error) {
	switch {
	case c.Open != nil:
		opened, err := open(c)
		if err != nil {
			return nil, err
		}
		*camera = opened
		return object{"opened": asJSON(opened.Opened())}, nil
	case c.Tick != nil:
		tick := &v1.Tick{}
		if err := protojson.Unmarshal(c.Tick, tick); err != nil {
			return nil, err
		}
		reply, err := (*camera).Tick(context.Background(), tick)
		if err != nil {
			return nil, err
		}
		return object{"camera": asJSON(reply)}, nil
	default:
		return object{"closed": object{"resyncs": (*camera).Resyncs(), "resumes": (*camera).Resumes()}}, (*camera).Close(context.Background())
	}
}

func errorAnswer(err error) object {
	var refused *sightline.Refused
	if errors.As(err, &refused) {
		return object{"refused": asJSON(refused.TickError)}
	}
	var failed *sightline.Failed
	if !errors.As(err, &failed) {
		log.Fatal(err)
	}
	violations := []json.RawMessage{}
	for _, violation := range failed.Violations {
		violations = append(violations, asJSON(violation))
	}
	return object{"failed": object{"code": codeName(failed.Code.String()), "violations": violations}}
}

// codeName is the name as the gRPC specification writes it: "NotFound" is NOT_FOUND.
func codeName(name string) string {
	var out strings.Builder
	for i, letter := range name {
		if i > 0 && letter >= 'A' && letter <= 'Z' {
			out.WriteByte('_')
		}
		out.WriteRune(letter)
	}
	return strings.ToUpper(out.String())
}

func main() {
	var camera *sightline.Camera
	var others live
	lines := bufio.NewScanner(os.Stdin)
	lines.Buffer(nil, 1<<26)
	for lines.Scan() {
		var c command
		if err := json.Unmarshal(lines.Bytes(), &c); err != nil {
			log.Fatal(err)
		}
		answer, known := others.run(lines.Bytes())
		if known {
			print(answer)
			continue
		}
		answer, err := run(&camera, c)
		if err != nil {
			answer = errorAnswer(err)
		}
		print(answer)
	}
}

func print(answer object) {
	text, err := json.Marshal(answer)
	if err != nil {
		log.Fatal(err)
	}
	fmt.Println(string(text))
}
