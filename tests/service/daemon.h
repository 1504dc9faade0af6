// The real sightlined as a child process.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace sightline {

struct RunResult {
  int exit_code = -1;
  std::string output, errors;
};

// Runs the daemon until it ends.
RunResult run_sightlined(const std::vector<std::string>& arguments);

// Starts it with the given arguments, and with the Embree sampler unless they name one. The destructor kills it if it
// still runs.
class Daemon {
 public:
  explicit Daemon(std::vector<std::string> arguments);
  ~Daemon();

  // Waits until clients can connect; false when it ends instead.
  bool wait_until_ready();
  // One address for each listener, as in the ready file.
  std::vector<std::string> addresses() const;
  bool ready_file_exists() const;
  void signal(int number) const;
  // Waits for the end: its exit code, or minus the signal that ended it.
  int wait();
  // All log output so far.
  std::string errors() const;

 private:
  const test::TemporaryFolder folder_;
  pid_t pid_ = -1;
};

std::string read_text(const std::string& path);

}  // namespace sightline
