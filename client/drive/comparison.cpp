#include "client/drive/comparison.h"

#include <algorithm>
#include <optional>

#include "client/page/contact_sheet.h"

namespace sightline {
namespace {

constexpr double kLostShare = 0.05, kClearShare = 0.95;
constexpr int kGap = 4, kLabelScale = 3, kLabelHeight = 10 * kLabelScale;
constexpr Rgb kGround{20, 22, 28}, kLabelColour{255, 255, 255};

void place_row(Picture& whole, ScenarioWorld& world, std::span<const CameraFrame> frames, int width, int top,
               const char* label) {
  draw_text(whole, 2 * kGap, top + kLabelScale, kLabelScale, label, kLabelColour);
  for (size_t i = 0; i < frames.size(); ++i)
    paste(whole, draw_frame(world, frames[i], width), static_cast<int>(i) * (width + kGap), top + kLabelHeight);
}

}  // namespace

std::vector<size_t> telling_frames(std::span<const FrameTruth> follow, std::span<const FrameTruth> sightline,
                                   size_t count) {
  std::vector<std::vector<size_t>> runs(1);
  std::optional<size_t> widest;
  double widest_difference = 0.0;
  for (size_t i = 0; i < std::min(follow.size(), sightline.size()); ++i) {
    if (!follow[i].picture || !sightline[i].picture) continue;
    const double theirs = follow[i].picture->least_whole_share(), ours = sightline[i].picture->least_whole_share();
    if (!widest || ours - theirs > widest_difference) widest = i, widest_difference = ours - theirs;
    if (theirs < kLostShare && ours >= kClearShare)
      runs.back().push_back(i);
    else if (!runs.back().empty())
      runs.emplace_back();
  }
  std::stable_sort(runs.begin(), runs.end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });
  std::vector<size_t> frames;
  for (const std::vector<size_t>& run : runs)
    if (!run.empty() && frames.size() < count) frames.push_back(run[run.size() / 2]);
  std::sort(frames.begin(), frames.end());
  if (frames.empty() && widest) frames.push_back(*widest);
  return frames;
}

Picture comparison(ScenarioWorld& world, std::span<const CameraFrame> follow, std::span<const CameraFrame> sightline,
                   int width) {
  const Picture first = draw_frame(world, follow.front(), width);
  const int row_height = kLabelHeight + first.height, columns = static_cast<int>(follow.size());
  Picture whole(columns * width + (columns - 1) * kGap, 2 * row_height, kGround);
  place_row(whole, world, follow, width, 0, "plain follow camera");
  place_row(whole, world, sightline, width, row_height, "Sightline");
  return whole;
}

}  // namespace sightline
