// A progress bar on a terminal.
#pragma once

#include <cstddef>
#include <ostream>
#include <string>

namespace sightline {

// Draws on `out`, or nothing when `enabled` is false (`out` is not a terminal). Not thread-safe.
class ProgressBar {
 public:
  ProgressBar(std::ostream& out, bool enabled) : out_(out), enabled_(enabled) {}
  ~ProgressBar() { clear(); }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void show(const std::string& what, size_t done, size_t of);
  // Erases the bar, so that a line can be printed.
  void clear();

 private:
  std::ostream& out_;
  const bool enabled_;
  int shown_permille_ = -1;
  std::string shown_what_;
};

}  // namespace sightline
