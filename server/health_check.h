// `sightlined healthcheck`: asks a running daemon how it is.
#pragma once

#include <ostream>
#include <string>

namespace sightline {

// Asks the health service at `address` ("127.0.0.1:50151", "unix:/run/sightline.sock") for `service` ("readiness", "liveness"). Prints the
// answer and returns 0 when it is SERVING; otherwise prints the reason to `err` and returns 1. Waits for at most two seconds.
int check_health(const std::string& address, const std::string& service, std::ostream& out, std::ostream& err);

}  // namespace sightline
