// A session's memory as a message of a recording.
#pragma once

#include "server/base/error.h"
#include "server/session/session.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// Fills `out`, whose strings are reused. Call it after a step, before the next tick.
void memory_to_proto(const Session& session, v1::StepMemory& out);

// Session::resume, with the checksum checked first.
Status resume_from_proto(const v1::StepMemory& memory, Session& session);

}  // namespace sightline
