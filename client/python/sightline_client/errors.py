"""The errors that a camera raises."""
from __future__ import annotations

from typing import Any, List

import grpc

from sightline.v1.errors_pb2 import FieldViolation, TickError
from sightline_client import call_details_pb2


class Failed(Exception):
    """The session could not be opened, or it was lost and no daemon took it over in time. The next tick of a camera that
    lost its session tries again.

    code: the gRPC status. UNAVAILABLE: no daemon answers, or the connection broke. violations: the fields of the request that are wrong,
    each with `field` and `description`; empty if the request was not the cause.
    """

    def __init__(self, code: grpc.StatusCode, message: str, violations: List[FieldViolation]) -> None:
        super().__init__(f"{code.name}: {message}")
        self.code = code
        self.violations = violations


class Refused(Exception):
    """The daemon refused a tick, and the session goes on. The text names the field and what is wrong. Nothing of the tick was applied,
    unless the text says that its step failed. error: the whole TickError."""

    def __init__(self, error: TickError) -> None:
        super().__init__(error.message)
        self.error = error


class QueueFull(Exception):
    """A tick that was not taken, because too many wait for a daemon."""


def unavailable(message: str) -> Failed:
    return Failed(grpc.StatusCode.UNAVAILABLE, message, [])


def as_refusal(failed: Failed, sequence: int) -> TickError:
    """Of a tick that ends each call in which it is sent. The kinds of errors have the names of gRPC's codes."""
    kind = "CODE_" + failed.code.name
    code = kind if kind in TickError.Code.keys() else "CODE_INVALID_ARGUMENT"
    return TickError(sequence=sequence, code=code, message=str(failed), field_violations=failed.violations)


def from_call(error: Any) -> Failed:
    """The error of a call that ended with a status: grpc.RpcError with the methods of grpc.Call, or grpc.aio.AioRpcError."""
    return Failed(error.code(), error.details() or "", _violations(error.trailing_metadata() or ()))


def _violations(metadata: Any) -> List[FieldViolation]:
    found: List[FieldViolation] = []
    for key, value in metadata:
        if key != "grpc-status-details-bin":
            continue
        for detail in call_details_pb2.CallDetails.FromString(value).details:
            if detail.TypeName() == "google.rpc.BadRequest":
                found.extend(call_details_pb2.BadRequest.FromString(detail.value).field_violations)
    return found
