// The errors that a camera throws.
import {create, fromBinary} from "@bufbuild/protobuf";
import {anyUnpack} from "@bufbuild/protobuf/wkt";
import {type ServiceError, status} from "@grpc/grpc-js";

import {BadRequestSchema} from "./gen/google/rpc/error_details_pb.js";
import {StatusSchema} from "./gen/google/rpc/status_pb.js";
import {TickError_Code, TickErrorSchema, type TickError} from "./gen/sightline/v1/errors_pb.js";

// A field of the request that is wrong.
export interface Violation {
  field: string;
  description: string;
}

// The session could not be opened, or it was lost and no daemon took it over in time. The next tick of a camera that lost its session
// tries again. `code` is the gRPC status; UNAVAILABLE: no daemon answers, or the connection broke. `violations` is empty if the request
// was not the cause.
export class Failed extends Error {
  constructor(readonly code: status, message: string, readonly violations: Violation[] = []) {
    super(`${status[code]}: ${message}`);
    this.name = "Failed";
  }
}

// The daemon refused a tick, and the session goes on. The message names the field and what is wrong. Nothing of the tick was applied,
// unless the message says that its step failed.
export class Refused extends Error {
  constructor(readonly error: TickError) {
    super(error.message);
    this.name = "Refused";
  }
}

// A tick that was not taken, because too many wait for a daemon.
export class QueueFull extends Error {
  constructor(message: string) {
    super(message);
    this.name = "QueueFull";
  }
}

export function failedCall(error: ServiceError): Failed {
  return new Failed(error.code, error.details, violationsOf(error));
}

// The refusal of a tick that ends each call in which it is sent. The kinds of errors have the names of gRPC's codes.
export function asRefusal({code, message, violations}: Failed, sequence: bigint): TickError {
  const kind = TickError_Code[status[code] as keyof typeof TickError_Code] ?? TickError_Code.INVALID_ARGUMENT;
  return create(TickErrorSchema, {sequence, code: kind, message, fieldViolations: violations});
}

export function unavailable(message: string): Failed {
  return new Failed(status.UNAVAILABLE, message);
}

function violationsOf(error: ServiceError): Violation[] {
  return error.metadata.get("grpc-status-details-bin").flatMap((value) =>
    fromBinary(StatusSchema, value as Buffer).details.flatMap((detail) =>
      (anyUnpack(detail, BadRequestSchema)?.fieldViolations ?? []).map(({field, description}) => ({field, description}))));
}
