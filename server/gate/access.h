// Who may speak, and what about: tokens, certificates and users, each with a role.
//
// The access file has one of them a line; `#` begins a comment:
//
//   token       game-1            control  k7Zq0fJw2tXo9LsB     the secret, 16 to 512 printable characters
//   token       dashboard         observe  sha256:5e88...d8     or its SHA-256 in hexadecimal
//   certificate game-2.example    control                       a name as in TlsStream::certificate_name; * is every
//   verified one user        1000              admin                         a numeric id or a name on the unix socket;
//   * is every user
//
// `control` opens sessions and uploads scenes, `observe` reads the server's counters, `admin` does both and also opens
// scenes that others uploaded. Each of them may read the server's information and list scenes. No name and no secret is
// there twice.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/error.h"
#include "server/base/mutex.h"
#include "server/gate/settled_files.h"

namespace sightline {

// What the gate knows of the other end of a connection.
struct Peer {
  std::string client;            // see client_of_socket
  std::optional<unsigned> user;  // its id, on a unix socket
  std::string certificate;       // the name in its verified certificate; empty: none
  bool confidential = false;     // nobody else can read what is sent: TLS, or a unix socket
};

enum class Role { kControl, kObserve, kAdmin };
// What a call needs.
enum class Need { kAnyRole, kControl, kObserve };

// One that may speak.
struct Caller {
  // for budgets and logs: "token game-1", "certificate game-2.example", "uid 1000", otherwise the address
  std::string name;
  // Without an access file there are no roles: everyone who may connect controls and observes.
  std::optional<Role> role;

  bool may(Need need) const;
  bool sees_all() const { return role == Role::kAdmin; }
};

// Why a call is refused. `known`: it is a valid caller, but its role does not allow the call.
struct Refusal {
  bool known = false;
  std::string reason;
};

// The contents of one access file. Immutable.
class AccessList {
 public:
  // Fails with kInvalidArgument, field "--access-file"; the text names the line.
  static Result<AccessList> parse(std::string_view text);

  // The caller with this token, in a time that does not depend on which tokens are similar; nothing when there is none.
  std::optional<Caller> find_token(std::string_view token) const;
  std::optional<Caller> find_certificate(const std::string& name) const;
  std::optional<Caller> find_user(unsigned id) const;
  // The role of a caller by its name.
  std::optional<Role> role_of(std::string_view caller) const;

  // Nobody is named.
  bool empty() const { return tokens_.empty() && certificates_.empty() && users_.empty(); }
  // A token's secret stands in the file itself, not as its digest.
  bool tells_secrets() const { return tells_secrets_; }

 private:
  using Digest = std::array<unsigned char, 32>;
  struct Token {
    std::string name;
    Role role;
    Digest digest;
    int line;
  };
  struct Named {
    Role role;
    int line;
  };
  using NamedRoles = std::map<std::string, Named>;

  Status read_line(std::string_view line, int number);
  Status add_token(const std::string& name, Role role, const std::string& secret, int number);
  static std::optional<Role> role_in(const NamedRoles& roles, const std::string& name);
  static std::optional<Digest> digest_of(std::string_view secret);

  std::vector<Token> tokens_;
  NamedRoles certificates_, users_;  // users_: by numeric id, or "*"
  bool tells_secrets_ = false;
};

// Decides for each call. Thread-safe.
class Access {
 public:
  // Without a file: everyone who may connect controls and observes.
  Access() = default;
  // Fails as AccessList::parse does, and when the file names nobody: that would shut everyone out.
  static Result<std::unique_ptr<Access>> load(const std::string& path);

  // Looks at the file again; the result is as of TlsKeys::reload.
  Result<bool> reload(SettledFiles::Time now);
  // As SettledFiles::settling.
  bool settling() const { return file_.settling(); }
  // What others can do with a file that holds secrets; see exposed_by_mode.
  std::string exposed() const;

  // `token` is what the caller sent; nothing: it sent none. A caller that sends a token is judged by it alone,
  // otherwise by its certificate, otherwise by its user.
  tl::expected<Caller, Refusal> identify(const Peer& peer, std::optional<std::string_view> token, Need need) const;
  // Calls that `identify` refused.
  uint64_t refused() const { return refused_; }
  // False when a caller of this name, who was let in before, may no longer have a session.
  bool still_controls(const std::string& name) const;

 private:
  tl::expected<Caller, Refusal> find(const Peer& peer, std::optional<std::string_view> token) const;
  std::shared_ptr<const AccessList> list() const;
  Status take(const std::string& text);

  std::string path_;       // constant after construction; empty: no file
  SettledFiles file_{{}};  // used by one thread at a time
  mutable std::atomic<uint64_t> refused_{0};
  mutable Mutex mutex_;
  std::shared_ptr<const AccessList> list_ GUARDED(mutex_);  // null: no file
};

}  // namespace sightline
