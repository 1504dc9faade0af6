package sightline

import (
	"context"
	"errors"
	"fmt"
	"io"
	"strings"
	"sync/atomic"
	"time"

	"google.golang.org/grpc"
	"google.golang.org/grpc/codes"
	"google.golang.org/grpc/credentials"
	"google.golang.org/grpc/credentials/insecure"
	"google.golang.org/grpc/status"

	v1 "sightline.dev/go/sightline/v1"
)

const (
	// Replies with depth maps exceed gRPC's default limit of 4 MiB.
	maxReplyBytes = 64 << 20
	chunkBytes    = 512 << 10
)

var errEnded = errors.New("the daemon has ended the call in order")

type response struct {
	message *v1.ControlResponse
	err     error // *Failed, or errEnded
}

// stream is one call of Control on a connection of its own.
type stream struct {
	connection *grpc.ClientConn
	client     v1.CameraControlServiceClient
	call       grpc.BidiStreamingClient[v1.ControlRequest, v1.ControlResponse]
	cancel     context.CancelFunc
	responses  chan response
	drained    atomic.Pointer[string] // the reason why the daemon takes no more ticks
}

// bearer shows the daemon a token. gRPC does not send it over a connection that others can read.
type bearer struct {
	token string
	local bool
}

func (b bearer) GetRequestMetadata(context.Context, ...string) (map[string]string, error) {
	return map[string]string{"authorization": "Bearer " + b.token}, nil
}

func (b bearer) RequireTransportSecurity() bool { return !b.local }

func dialOptions(address string, options *Options) []grpc.DialOption {
	local := strings.HasPrefix(address, "unix:")
	transport := insecure.NewCredentials()
	if options.TLS != nil && !local {
		transport = credentials.NewTLS(options.TLS)
	}
	chosen := []grpc.DialOption{grpc.WithTransportCredentials(transport), grpc.WithDefaultCallOptions(grpc.MaxCallRecvMsgSize(maxReplyBytes))}
	if options.Token != "" {
		chosen = append(chosen, grpc.WithPerRPCCredentials(bearer{options.Token, local}))
	}
	return chosen
}

func openStream(address string, options *Options) (*stream, error) {
	if options.Token != "" && options.TLS == nil && !strings.HasPrefix(address, "unix:") {
		return nil, failedCall(status.Error(codes.InvalidArgument, "Options.Token is sent only over TLS (Options.TLS) or a unix socket"))
	}
	connection, err := grpc.NewClient(address, dialOptions(address, options)...)
	if err != nil {
		return nil, failedCall(err)
	}
	ctx, cancel := context.WithCancel(context.Background())
	s := &stream{connection: connection, client: v1.NewCameraControlServiceClient(connection), cancel: cancel, responses: make(chan response, 16)}
	if s.call, err = s.client.Control(ctx); err != nil {
		s.cutOff()
		return nil, failedCall(err)
	}
	go s.read(ctx)
	return s, nil
}

func (s *stream) read(ctx context.Context) {
	for {
		message, err := s.call.Recv()
		if drain := message.GetDrain(); err == nil && drain != nil {
			reason := drain.GetReason()
			s.drained.Store(&reason)
			_ = s.call.CloseSend() // the daemon need not wait for more ticks; it answers those that it has
		}
		next := response{message: message}
		if errors.Is(err, io.EOF) {
			next.err = errEnded
		} else if err != nil {
			next.err = failedCall(err)
		}
		select {
		case s.responses <- next:
		case <-ctx.Done():
			return
		}
		if err != nil {
			return
		}
	}
}

// send queues a message. When the call has ended, receive says why.
func (s *stream) send(request *v1.ControlRequest) {
	if s.drained.Load() == nil {
		_ = s.call.Send(request)
	}
}

// next is the next response, or errEnded.
func (s *stream) next(ctx context.Context, timeout time.Duration) (*v1.ControlResponse, error) {
	timer := time.NewTimer(timeout)
	defer timer.Stop()
	select {
	case got := <-s.responses:
		return got.message, got.err
	case <-timer.C:
		return nil, unavailable(fmt.Sprintf("the daemon has answered nothing for %v", timeout))
	case <-ctx.Done():
		return nil, ctx.Err()
	}
}

// receive is the next response; a call that has ended is an error.
func (s *stream) receive(ctx context.Context, timeout time.Duration) (*v1.ControlResponse, error) {
	message, err := s.next(ctx, timeout)
	if !errors.Is(err, errEnded) {
		return message, err
	}
	if reason := s.drained.Load(); reason != nil {
		return nil, unavailable(*reason)
	}
	return nil, unavailable("the daemon has ended the session")
}

// opened is the answer to the first message. After an error the stream is cut off.
func (s *stream) opened(ctx context.Context, timeout time.Duration) (*v1.SessionOpened, error) {
	for {
		message, err := s.receive(ctx, timeout)
		if err != nil {
			s.cutOff()
			return nil, err
		}
		if opened := message.GetOpened(); opened != nil {
			return opened, nil
		}
	}
}

// upload returns the hash of the scene.
func (s *stream) upload(ctx context.Context, scene []byte) (string, error) {
	call, err := s.client.UploadScene(ctx)
	if err != nil {
		return "", failedCall(err)
	}
	for at := 0; at < len(scene); at += chunkBytes {
		if call.Send(&v1.UploadSceneRequest{Chunk: scene[at:min(at+chunkBytes, len(scene))]}) != nil {
			break // CloseAndRecv says why
		}
	}
	uploaded, err := call.CloseAndRecv()
	if err != nil {
		return "", failedCall(err)
	}
	return uploaded.GetHash(), nil
}

// finish ends the session in order.
func (s *stream) finish(ctx context.Context, timeout time.Duration) error {
	defer s.cutOff()
	_ = s.call.CloseSend()
	for {
		if _, err := s.next(ctx, timeout); errors.Is(err, errEnded) {
			return nil
		} else if err != nil {
			return err
		}
	}
}

func (s *stream) cutOff() {
	s.cancel()
	_ = s.connection.Close()
}
