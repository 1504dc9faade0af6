// What the kernel says about this process: memory, processor time, file descriptors.
#pragma once

#include <chrono>
#include <cstdint>

namespace sightline {

// A figure that the kernel does not tell is 0.
struct ProcessFigures {
  uint64_t resident_bytes = 0, virtual_bytes = 0;
  double cpu_s = 0.0;     // of all threads, in user and kernel mode
  double start_s = 0.0;   // since 1970 (UTC)
  double uptime_s = 0.0;  // since the start
  uint64_t open_descriptors = 0, max_descriptors = 0;
  uint64_t threads = 0;
};

// For how long a thread of this process has run, or waited for a processor, since its start. 0 when the kernel does not
// tell.
std::chrono::nanoseconds busy_time_of_thread(int thread);

// Reads /proc/self, in less than a millisecond. Thread-safe, as the function above.
ProcessFigures process_figures();

}  // namespace sightline
