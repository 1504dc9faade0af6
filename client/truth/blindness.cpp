#include "client/truth/blindness.h"

#include <algorithm>

namespace sightline {

std::vector<BlindStretch> blind_stretches(std::span<const CameraFrame> frames, std::span<const FrameTruth> truths) {
  std::vector<BlindStretch> stretches;
  bool blind = false;
  for (size_t i = 0; i < std::min(frames.size(), truths.size()); ++i) {
    if (!truths[i].picture) continue;
    const bool before = blind;
    blind = truths[i].picture->fully_hidden();
    if (blind && !before) stretches.push_back({i, i});
    if (blind || before) stretches.back().end = i;
  }
  return stretches;
}

}  // namespace sightline
