#pragma once

#include <sys/resource.h>

#include <cstddef>

namespace sightline {

// The most memory that the process ever held. Always 0 under sanitizers, because they keep freed memory.
inline size_t peak_bytes() {
#ifdef __SANITIZE_ADDRESS__
  return 0;
#else
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<size_t>(usage.ru_maxrss) * 1024;
#endif
}

}  // namespace sightline
