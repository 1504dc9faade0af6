// Included first by every source that instrument.py has rewritten. All mutants of a program are compiled into it; the
// environment chooses the one that is switched on:
//   SIGHTLINE_MUTANT=N         mutant N is on; without it none is
//   SIGHTLINE_REACHED=FILE     a byte for each mutant, set to 1 when the program comes past it; processes may share the
//   file
#pragma once
#pragma GCC system_header  // a constant of another sign than its neighbour is no error here either

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>

namespace mutation {

inline unsigned char* map_reached() {
  const char* const path = std::getenv("SIGHTLINE_REACHED");
  const int file = path ? ::open(path, O_RDWR | O_CLOEXEC) : -1;
  if (file < 0) return nullptr;
  struct stat status {};
  ::fstat(file, &status);
  void* const bytes = ::mmap(nullptr, static_cast<size_t>(status.st_size), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  ::close(file);
  return bytes == MAP_FAILED ? nullptr : static_cast<unsigned char*>(bytes);
}

inline const int chosen = std::getenv("SIGHTLINE_MUTANT") ? std::atoi(std::getenv("SIGHTLINE_MUTANT")) : -1;
inline unsigned char* const reached = map_reached();

inline bool on(int id) {
  if (reached) [[unlikely]]
    reached[id] = 1;
  return chosen == id;
}

// The mutations of expressions. Without the mutant each gives what the source says.
inline bool negate(int id, bool value) {
  return on(id) != value;
}
inline auto less(int id, const auto& a, const auto& b) {
  return on(id) ? a <= b : a < b;
}
inline auto less_equal(int id, const auto& a, const auto& b) {
  return on(id) ? a < b : a <= b;
}
inline auto greater(int id, const auto& a, const auto& b) {
  return on(id) ? a >= b : a > b;
}
inline auto greater_equal(int id, const auto& a, const auto& b) {
  return on(id) ? a > b : a >= b;
}
inline auto add(int id, const auto& a, const auto& b) {
  return on(id) ? a - b : a + b;
}
inline auto subtract(int id, const auto& a, const auto& b) {
  return on(id) ? a + b : a - b;
}
inline auto multiply(int id, const auto& a, const auto& b) {
  return on(id) ? a / b : a * b;
}
inline auto divide(int id, const auto& a, const auto& b) {
  return on(id) ? a * b : a / b;
}
inline auto minus(int id, const auto& a) {
  return on(id) ? +a : -a;
}
template <typename T>
T min(int id, const T& a, const T& b) {
  return (b < a) != on(id) ? b : a;
}
template <typename T>
T max(int id, const T& a, const T& b) {
  return (a < b) != on(id) ? b : a;
}

}  // namespace mutation
