#include "client/drive/comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sightline {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

// Frames in which both targets are visible to these shares, in hundredths, and this part of their outlines is in the
// picture; -1: not judged.
std::vector<FrameTruth> truths(const std::vector<std::pair<int, int>>& shares, double in_picture = 1.0) {
  std::vector<FrameTruth> frames(shares.size());
  for (size_t i = 0; i < shares.size(); ++i) {
    if (shares[i].first < 0) continue;
    frames[i].picture.emplace();
    for (const int share : {shares[i].first, shares[i].second}) {
      TargetTruth& target = frames[i].picture->targets.emplace_back();
      target.alone_pixels = 100;
      target.visible_pixels = static_cast<uint32_t>(share);
      target.outline.in_picture_share = in_picture;
    }
  }
  return frames;
}

constexpr std::pair<int, int> kClear{100, 100}, kOneLost{0, 100}, kBothLost{0, 0}, kHalf{50, 100}, kUnjudged{-1, -1};

TEST(TellingFrames, AreTheMiddlesOfTheLongestRunsInOrderOfTime) {
  const auto follow = truths(
      {kOneLost, kClear, kOneLost, kBothLost, kOneLost, kClear, kBothLost, kBothLost, kBothLost, kBothLost, kBothLost});
  const auto ours = truths(std::vector(11, kClear));
  EXPECT_THAT(telling_frames(follow, ours, 1), ElementsAre(8u));
  EXPECT_THAT(telling_frames(follow, ours, 2), ElementsAre(3u, 8u));
  EXPECT_THAT(telling_frames(follow, ours, 5), ElementsAre(0u, 3u, 8u));
}

TEST(TellingFrames, AreThoseInWhichSightlineSeesEverything) {
  const auto follow = truths({kBothLost, kBothLost, kBothLost, kBothLost});
  EXPECT_THAT(telling_frames(follow, truths({kHalf, kHalf, kHalf, kClear}), 1), ElementsAre(3u));
}

TEST(TellingFrames, ABodyThatThePictureCutsOffIsNotShown) {
  const auto follow = truths({kBothLost, kBothLost, kBothLost, kBothLost});
  auto ours = truths(std::vector(3, kClear), 0.5);
  ours.push_back(truths({kClear}).front());
  EXPECT_THAT(telling_frames(follow, ours, 1), ElementsAre(3u));
}

TEST(TellingFrames, SkipFramesThatWereNotJudged) {
  const auto follow = truths({kUnjudged, kOneLost, kUnjudged, kUnjudged, kOneLost, kUnjudged, kUnjudged, kOneLost});
  EXPECT_THAT(telling_frames(follow, truths(std::vector(8, kClear)), 1), ElementsAre(4u));
  EXPECT_THAT(telling_frames(truths({kUnjudged}), truths({kUnjudged}), 1), IsEmpty());
}

TEST(TellingFrames, AreTheGreatestDifferenceWhereNothingIsLost) {
  EXPECT_THAT(telling_frames(truths({kClear, kHalf, kClear}), truths(std::vector(3, kClear)), 3), ElementsAre(1u));
}

}  // namespace
}  // namespace sightline
