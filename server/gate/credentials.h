// The files that decide who may speak, together: the certificate, its key, the authority of clients, and the access
// file.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/gate/access.h"
#include "server/gate/tls.h"

namespace sightline {

struct CredentialFiles {
  std::string access;  // empty: everyone who may connect may speak
  TlsFiles tls;        // empty: nothing is encrypted
};

// Thread-safe, except that `reload` and `settling` must be called by one thread at a time.
class Credentials {
 public:
  // No files.
  Credentials() : access_(std::make_unique<Access>()) {}
  // Fails with kInvalidArgument; the field is the flag of the file.
  static Result<std::unique_ptr<Credentials>> load(const CredentialFiles& files);

  const Access& access() const { return *access_; }
  const TlsKeys* tls() const { return tls_.get(); }  // null: nothing is encrypted

  // What became of a file that has changed.
  struct Change {
    std::string what;              // "certificate", "access file"
    std::optional<Error> trouble;  // why it cannot be used; the former contents stay in use
  };
  // Looks at all files again, and takes over those that have changed and settled.
  std::vector<Change> reload(SettledFiles::Time now);
  // A change has been seen that has not settled yet: call `reload` again after SettledFiles::kSettle.
  bool settling() const { return access_->settling() || (tls_ && tls_->settling()); }
  // What the modes of the files let other users do with them, for a person; empty: nothing that matters.
  std::vector<std::string> exposed() const;

  // Counts of the changes of a file since the start. Those of the certificate include its key and the file of the
  // clients' authorities.
  struct FileCounts {
    std::atomic<uint64_t> taken_over{0}, refused{0};  // changes that came into use, and those that could not be used
    std::atomic<bool> current{true};                  // false: the newest contents could not be used
  };
  const FileCounts& access_file() const { return access_file_; }
  const FileCounts& certificate() const { return certificate_; }
  // The sums over both files.
  uint64_t taken_over() const { return access_file_.taken_over + certificate_.taken_over; }
  uint64_t refused() const { return access_file_.refused + certificate_.refused; }

 private:
  std::unique_ptr<Access> access_;
  std::unique_ptr<TlsKeys> tls_;
  FileCounts access_file_, certificate_;
};

}  // namespace sightline
