// The two things that are said under load: Sightline's Control, and a bare echo of as many bytes.
#pragma once

#include <memory>

#include "client/bench/stream.h"
#include "client/bench/world.h"

namespace sightline {

// Session `session` of `world`, opened with `open`. `world` must outlive it.
std::unique_ptr<BenchProtocol> control_protocol(const BenchWorld& world, size_t session, v1::OpenSession open);

// Says to the echo (bench_echo.h) what `twin` says to the daemon, byte for byte as long, and asks for as many bytes back as the
// daemon last answered there. Built without protobuf on either side. `twin` must outlive it.
std::unique_ptr<BenchProtocol> echo_protocol(const BenchStream& twin);

// StepFlags.degraded of a reply: true, or a message that is there. False for servers whose protocol has no such flag.
bool is_degraded(const v1::StepFlags& flags);

}  // namespace sightline
