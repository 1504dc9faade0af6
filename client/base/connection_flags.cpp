#include "client/base/connection_flags.h"

#include <CLI/CLI.hpp>
#include <fstream>
#include <iterator>

namespace sightline {
namespace {

Status read_into(std::string& text, const std::string& path, const char* flag) {
  if (path.empty()) return {};
  std::ifstream file(path, std::ios::binary);
  text.assign(std::istreambuf_iterator<char>(file), {});
  return file.is_open() && !file.bad() ? Status{} : fail(ErrorCode::kUnavailable, flag, path + " cannot be read");
}

// A file that an editor or `echo` has written ends with a line feed.
std::string without_line_end(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  return text;
}

}  // namespace

void add_connection_flags(CLI::App& command, ConnectionFlags& flags) {
  command.add_flag("--tls", flags.tls, "Encrypt TCP, for a daemon with --tls-cert");
  command
      .add_option("--tls-roots", flags.roots,
                  "File of the certificates, in PEM format, of which one must have signed the daemon's; implies --tls. "
                  "Default: those that "
                  "gRPC knows")
      ->type_name("FILE");
  command
      .add_option("--tls-cert", flags.certificate,
                  "File of the certificate, in PEM format, that the daemon sees of this caller; implies --tls. For a "
                  "daemon with "
                  "--tls-client-ca")
      ->type_name("FILE");
  command.add_option("--tls-key", flags.key, "File of its key, in PEM format")->type_name("FILE");
  command
      .add_option("--token-file", flags.token,
                  "File of the token that the daemon knows this caller by; needs TLS or a unix socket. For a daemon "
                  "with --access-file")
      ->type_name("FILE");
}

Result<ClientCredentials> read_credentials(const ConnectionFlags& flags) {
  if (flags.certificate.empty() != flags.key.empty())
    return invalid(flags.key.empty() ? "--tls-key" : "--tls-cert", "--tls-cert and --tls-key are needed together");
  ClientCredentials credentials;
  credentials.tls = flags.tls || !flags.roots.empty() || !flags.certificate.empty();
  Status status = read_into(credentials.roots, flags.roots, "--tls-roots");
  if (status) status = read_into(credentials.certificate, flags.certificate, "--tls-cert");
  if (status) status = read_into(credentials.key, flags.key, "--tls-key");
  if (status) status = read_into(credentials.token, flags.token, "--token-file");
  if (!status) return tl::unexpected(std::move(status.error()));
  credentials.token = without_line_end(std::move(credentials.token));
  return credentials;
}

}  // namespace sightline
