// A bar on a terminal while something long goes on.
#pragma once

#include <cstddef>
#include <ostream>
#include <string>

namespace sightline {

// Draws on `out`; nothing at all when `enabled` is false (not a terminal). One thread at a time.
class ProgressBar {
 public:
  ProgressBar(std::ostream& out, bool enabled) : out_(out), enabled_(enabled) {}
  ~ProgressBar() { clear(); }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void show(const std::string& what, size_t done, size_t of);
  // Takes the bar away, so that a line can be printed.
  void clear();

 private:
  std::ostream& out_;
  const bool enabled_;
  int shown_permille_ = -1;
  std::string shown_what_;
};

}  // namespace sightline
