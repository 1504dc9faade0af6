// The daemon's process: starting it, and measuring the resources that it uses.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/error.h"

namespace sightline {

// The resources that a process has used since its start.
struct ProcessUsage {
  int64_t cpu_ns = 0;  // user and system time of all threads
  size_t resident_bytes = 0;
};
// kUnavailable when the process does not exist or belongs to another user.
Result<ProcessUsage> usage_of(pid_t pid);

// A new folder in the system's temporary folder. It is removed, with its contents, on destruction.
class ScratchFolder {
 public:
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::string& path() const { return path_; }  // "" when it could not be made

 private:
  std::string path_;
};

// A child that ends with its parent, however the parent ends. Used by one thread at a time.
class ChildProcess {
 public:
  // Starts the program at the path `program`. Its output goes to the new file `log`.
  static Result<std::unique_ptr<ChildProcess>> start(const std::string& program, std::vector<std::string> arguments,
                                                     const std::string& log);
  ~ChildProcess();  // SIGTERM, then SIGKILL after 5 s
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  pid_t pid() const { return pid_; }
  // Waits until `file` holds a whole line and returns that line. kUnavailable when the process ends first or `timeout`
  // passes; the message quotes the end of its log.
  Result<std::string> wait_for_line(const std::string& file, std::chrono::nanoseconds timeout);

 private:
  ChildProcess(std::string program, std::string log, pid_t pid)
      : program_(std::move(program)), log_(std::move(log)), pid_(pid) {}
  bool has_ended();  // reaps it

  const std::string program_, log_;
  const pid_t pid_;
  bool ended_ = false;
};

}  // namespace sightline
