// Processes that a load starts and watches: the daemon, the echo.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/error.h"

namespace sightline {

// What a process has used so far.
struct ProcessUsage {
  int64_t cpu_ns = 0;  // of all its threads, user and system
  size_t resident_bytes = 0;
};
// kUnavailable when there is no such process, or none of this user.
Result<ProcessUsage> usage_of(pid_t pid);

// A new folder below the system's temporary one, removed with everything in it at the end.
class ScratchFolder {
 public:
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// Ends with its parent, however that ends. One thread at a time.
class ChildProcess {
 public:
  // `program` is a path. What it writes goes to `output` and `errors`, new files; its standard input is empty but open.
  static Result<std::unique_ptr<ChildProcess>> start(const std::string& program,
                                                     std::vector<std::string> arguments,
                                                     const std::string& output, const std::string& errors);
  ~ChildProcess();  // as stop, with a grace of 5 s
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  pid_t pid() const { return pid_; }
  // Waits until `file` holds a whole line and returns it. kUnavailable when the process ends first, with the end of what it
  // said in `errors`, or when `timeout` passes.
  Result<std::string> wait_for_line(const std::string& file, std::chrono::nanoseconds timeout);
  // SIGTERM, and SIGKILL after `grace`. The exit status; -1: a signal ended it, or it was over.
  int stop(std::chrono::nanoseconds grace);

 private:
  ChildProcess(std::string program, std::string errors, pid_t pid, int input);
  bool ended();  // reaps it

  const std::string program_, errors_;
  pid_t pid_;
  int input_;
  std::optional<int> status_;  // as waitpid says, once it has ended
};

}  // namespace sightline
