#include "client/bench/process.h"

#include <unistd.h>

#include <ctime>
#include <fstream>
#include <string>

namespace sightline {

Result<ProcessUsage> usage_of(pid_t pid) {
  clockid_t clock{};
  timespec used{};
  size_t total_pages = 0, resident_pages = 0;
  std::ifstream statm("/proc/" + std::to_string(pid) + "/statm");
  if (clock_getcpuclockid(pid, &clock) != 0 || clock_gettime(clock, &used) != 0 ||
      !(statm >> total_pages >> resident_pages))
    return fail(ErrorCode::kUnavailable, "pid", "there is no process " + std::to_string(pid) + " to watch");
  return ProcessUsage{used.tv_sec * int64_t{1'000'000'000} + used.tv_nsec,
                      resident_pages * static_cast<size_t>(sysconf(_SC_PAGESIZE))};
}

}  // namespace sightline
