// `sightlined healthcheck`: asks a running daemon how it is.
#pragma once

#include <ostream>
#include <string>

namespace sightline {

// Where the health service is.
struct HealthAddress {
  std::string address;  // "127.0.0.1:50151", "unix:/run/sightline.sock"
  // The daemon speaks TLS there. Must be false for a unix socket. The certificate is not verified. The question has no
  // secret in it, and the address of a probe is rarely a name of the certificate. A file that was just replaced can
  // also be newer than what the daemon shows.
  bool tls = false;
  // PEM files of the certificate that the prober shows, for a daemon that wants one of every client; empty: none.
  std::string certificate, key;
};

// Asks for `service` ("readiness", "liveness"). Prints the answer and returns 0 when it is SERVING; otherwise prints
// the reason to `err` and returns 1. Waits for at most two seconds.
int check_health(const HealthAddress& where, const std::string& service, std::ostream& out, std::ostream& err);

}  // namespace sightline
