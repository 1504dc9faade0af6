// The resources that a process uses.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>

#include "server/base/error.h"

namespace sightline {

// The resources that a process has used since its start.
struct ProcessUsage {
  int64_t cpu_ns = 0;  // user and system time of all threads
  size_t resident_bytes = 0;
};
// kUnavailable when the process does not exist or belongs to another user.
Result<ProcessUsage> usage_of(pid_t pid);

}  // namespace sightline
