// Conversion of a session's answers to wire messages, in the client's convention and units.
#pragma once

#include <cstdint>

#include "server/base/error.h"
#include "server/session/session.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Fills `out` with a step's answer. `session` must be the one that gave it, without a step since, because `wanted`
// may ask for its intermediate results. Clears `out` first and reuses its memory. Single-threaded, like the session.
void camera_reply_to_proto(const SessionAnswer& answer, const Session& session, const DiagnosticsWanted& wanted,
                           v1::CameraReply& out);

// Fills `out` with the reason why tick `sequence` was refused. Asks for a resync if a mirror is given and the error
// shows that client and mirror hold different instances: an unknown or taken id, or another revision.
void tick_error_to_proto(const Error& error, uint64_t sequence, const SceneMirror* mirror, v1::TickError& out);

v1::TrackingStatus to_proto(TrackingStatus status);

// Fills the session's part of the message; the caller sets `session_id`, `sampler` and `warnings`.
void opened_to_proto(const Session& session, v1::SessionOpened& out);

}  // namespace sightline
