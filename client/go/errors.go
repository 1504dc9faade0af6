package sightline

import (
	"errors"
	"fmt"
	"slices"
	"strings"

	"google.golang.org/genproto/googleapis/rpc/errdetails"
	"google.golang.org/grpc/codes"
	"google.golang.org/grpc/status"

	v1 "sightline.dev/go/sightline/v1"
)

// Failed is the error of a session that could not be opened, or that was lost and that no daemon took over in time. The next tick of
// a camera that lost its session tries again. It wraps the gRPC status, so status.FromError works on it.
type Failed struct {
	Code       codes.Code
	Message    string
	Violations []*v1.FieldViolation // the fields of the request that are wrong; empty if the request was not the cause
	cause      error
}

func (f *Failed) Error() string { return fmt.Sprintf("%v: %s", f.Code, f.Message) }

// Unwrap returns the gRPC error.
func (f *Failed) Unwrap() error { return f.cause }

// Refused is the error of a tick that the daemon refused; the session goes on. The message names the field and what is wrong. Nothing of
// the tick was applied, unless the message says that its step failed.
type Refused struct {
	TickError *v1.TickError
}

func (r *Refused) Error() string { return r.TickError.GetMessage() }

func failedCall(err error) *Failed {
	found := status.Convert(err)
	failed := &Failed{Code: found.Code(), Message: found.Message(), cause: err}
	for _, detail := range found.Details() {
		if bad, ok := detail.(*errdetails.BadRequest); ok {
			for _, violation := range bad.GetFieldViolations() {
				failed.Violations = append(failed.Violations, &v1.FieldViolation{Field: violation.GetField(), Description: violation.GetDescription()})
			}
		}
	}
	return failed
}

var refusalCodes = map[codes.Code]v1.TickError_Code{
	codes.NotFound: v1.TickError_CODE_NOT_FOUND, codes.AlreadyExists: v1.TickError_CODE_ALREADY_EXISTS,
	codes.FailedPrecondition: v1.TickError_CODE_FAILED_PRECONDITION, codes.ResourceExhausted: v1.TickError_CODE_RESOURCE_EXHAUSTED,
}

// asRefusal is the refusal of a tick that ends each call in which it is sent.
func (f *Failed) asRefusal(sequence uint64) *Refused {
	code, known := refusalCodes[f.Code]
	if !known {
		code = v1.TickError_CODE_INVALID_ARGUMENT
	}
	return &Refused{&v1.TickError{Sequence: sequence, Code: code, Message: f.Error(), FieldViolations: f.Violations}}
}

func unavailable(message string) *Failed {
	return failedCall(status.Error(codes.Unavailable, message))
}

var lostCodes = []codes.Code{codes.Unavailable, codes.Canceled, codes.Unknown, codes.Internal, codes.DeadlineExceeded, codes.Aborted}

// isLost says whether another attempt, or another daemon, may help. A scene file that is too large stays so.
func isLost(err error, opening bool) bool {
	var failed *Failed
	if !errors.As(err, &failed) {
		return false
	}
	return slices.Contains(lostCodes, failed.Code) || (opening && failed.Code == codes.ResourceExhausted && !failed.names("chunk"))
}

func lacksScene(err error) bool {
	var failed *Failed
	return errors.As(err, &failed) && failed.Code == codes.NotFound && failed.names("scene")
}

// names says whether a part of a field that is wrong has this name.
func (f *Failed) names(part string) bool {
	return slices.ContainsFunc(f.Violations, func(v *v1.FieldViolation) bool { return strings.Contains(v.GetField(), part) })
}
