// Flags of the verbs that connect to a daemon: how the connection is encrypted, and who the caller is.
#pragma once

#include <string>

#include "client/cpp/sightline_client.h"

namespace CLI {
class App;
}

namespace sightline {

// Names of files, which are read when the verb runs. The token comes from a file because other users can see the
// arguments of a process.
struct ConnectionFlags {
  bool tls = false;  // encrypt TCP; one of the next three says so as well
  std::string roots{}, certificate{}, key{};
  std::string token{};
};

void add_connection_flags(CLI::App& command, ConnectionFlags& flags);

// Fails with kUnavailable, and the flag as the field, when a file cannot be read; with kInvalidArgument when a
// certificate comes without its key.
Result<ClientCredentials> read_credentials(const ConnectionFlags& flags);

}  // namespace sightline
