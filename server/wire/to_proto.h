// From what a session answers to wire messages, in the client's convention and units.
#pragma once

#include <cstdint>

#include "server/base/error.h"
#include "server/session/session.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Fills `out` with a step's answer; `session` is the one that gave it, not stepped since (its intermediates
// are dumped when `wanted` asks for them). Clears `out` first and reuses its memory. Single-threaded, as the
// session.
void camera_reply_to_proto(const SessionAnswer& answer, const Session& session,
                           const DiagnosticsWanted& wanted, v1::CameraReply& out);

// Fills `out` with why tick `sequence` was refused. With a mirror, and when the error says that client and
// mirror disagree about which instances there are (an unknown or taken id, another revision), a resync is
// asked for.
void tick_error_to_proto(const Error& error, uint64_t sequence, const SceneMirror* mirror, v1::TickError& out);

// Fills what a session tells of itself once it is open; `session_id`, `sampler` and `warnings` are the
// caller's.
void opened_to_proto(const Session& session, v1::SessionOpened& out);

}  // namespace sightline
