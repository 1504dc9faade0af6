#include "client/base/progress_bar.h"

#include <iomanip>

namespace sightline {

void ProgressBar::show(const std::string& what, size_t done, size_t of) {
  if (!enabled_) return;
  const int permille = of == 0 ? 1000 : static_cast<int>(1000 * done / of);
  if (permille == shown_permille_ && what == shown_what_) return;
  shown_permille_ = permille;
  shown_what_ = what;
  constexpr int kWidth = 40;
  const int filled = kWidth * permille / 1000;
  out_ << '\r' << std::left << std::setw(10) << what << std::right << " [" << std::string(filled, '#')
       << std::string(kWidth - filled, '.') << "] " << std::setw(3) << permille / 10 << " %" << std::flush;
}

void ProgressBar::clear() {
  if (!enabled_ || shown_permille_ < 0) return;
  out_ << "\r\x1b[K" << std::flush;
  shown_permille_ = -1;
}

}  // namespace sightline
