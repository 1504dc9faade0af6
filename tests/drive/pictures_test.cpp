// What the pictures of a drive show, by the colours of their pixels.
#include <gtest/gtest.h>

#include "client/drive/comparison.h"
#include "client/page/contact_sheet.h"
#include "tests/support/small_scenes.h"

namespace sightline {
namespace {

constexpr Rgb kFirst{230, 159, 0}, kSecond{86, 180, 233};  // of the outlines
constexpr int kWidth = 160, kCaption = 22;                 // pixels

// Two people side by side, 8 m before the camera. From 0.5 s on a wall stands before the one on the right.
class PicturesTest : public testing::Test {
 protected:
  PicturesTest() {
    test::SmallScene scene(1.0, {0, 1, 8});
    scenes::Motion slide;
    slide.add(0.0, {30, 0, 4}, {1, 0, 0, 0}), slide.add(0.45, {30, 0, 4}, {1, 0, 0, 0});
    slide.add(0.5, {1.5, 0, 4}, {1, 0, 0, 0}), slide.add(1.0, {1.5, 0, 4}, {1, 0, 0, 0});
    scene.target("anna", {-1.5, 0, 0}).target("ben", {1.5, 0, 0}).mover("wall", {2, 3, 0.2}, slide);
    place_ = std::make_unique<test::Place>(scene);
    world_ = place_->world();
  }
  CameraFrame at(double time_s) const {
    CameraFrame frame;
    frame.time_s = time_s;
    frame.camera = {{0, 1, 8}, {1, 0, 0, 0}};
    frame.lens = place_->scenario.lens();
    return frame;
  }
  // Pixels of a colour below the caption, in the left and in the right half.
  struct Count {
    int left = 0, right = 0;
  };
  static Count count(const Picture& picture, Rgb colour) {
    Count found;
    for (int y = kCaption; y < picture.height; ++y)
      for (int x = 0; x < picture.width; ++x)
        if (picture.at(x, y) == colour) ++(x < picture.width / 2 ? found.left : found.right);
    return found;
  }
  // Whether a part of the whole is the same as a picture.
  static bool holds(const Picture& whole, const Picture& part, int left, int top) {
    if (left + part.width > whole.width || top + part.height > whole.height) return false;
    for (int y = 0; y < part.height; ++y)
      for (int x = 0; x < part.width; ++x)
        if (whole.at(left + x, top + y) != part.at(x, y)) return false;
    return true;
  }

  std::unique_ptr<test::Place> place_;
  std::unique_ptr<ScenarioWorld> world_;
};

TEST_F(PicturesTest, EachTargetHasAnOutlineInItsColour) {
  const Picture picture = draw_frame(*world_, at(0.0), kWidth);
  EXPECT_EQ(picture.width, kWidth);
  EXPECT_EQ(picture.height, std::lround(kWidth / at(0.0).lens.aspect));
  const Count first = count(picture, kFirst), second = count(picture, kSecond);
  EXPECT_GT(first.left, 20);
  EXPECT_EQ(first.right, 0);
  EXPECT_EQ(second.left, 0);
  EXPECT_NEAR(second.right, first.left, 4) << "the same people, mirrored";
}

TEST_F(PicturesTest, WhatIsHiddenIsHatched) {
  const Picture seen = draw_frame(*world_, at(0.0), kWidth), hidden = draw_frame(*world_, at(0.9), kWidth);
  EXPECT_EQ(count(hidden, kFirst).left, count(seen, kFirst).left);
  EXPECT_GT(count(hidden, kSecond).right, count(seen, kSecond).right + 10);
}

TEST_F(PicturesTest, ASheetShowsEvenlySpacedFramesFromTheFirstToTheLast) {
  std::vector<CameraFrame> frames;
  for (int k = 0; k < 7; ++k) frames.push_back(at(k / 6.0));
  const Picture sheet = contact_sheet(*world_, frames, {.columns = 2, .rows = 2, .panel_width = kWidth});
  const Picture panel = draw_frame(*world_, frames[0], kWidth);
  EXPECT_EQ(sheet.width, 2 * (panel.width + 4) + 4);
  EXPECT_EQ(sheet.height, 2 * (panel.height + 4) + 4);
  for (int k = 0; k < 4; ++k)
    EXPECT_TRUE(holds(sheet, draw_frame(*world_, frames[static_cast<size_t>(2 * k)], kWidth), 4 + k % 2 * (panel.width + 4),
                      4 + k / 2 * (panel.height + 4)))
        << k;
  EXPECT_TRUE(holds(contact_sheet(*world_, frames, {.columns = 1, .rows = 1, .panel_width = kWidth}), panel, 4, 4));
}

TEST_F(PicturesTest, AComparisonHasTheFollowCamerasRowAboveSightlines) {
  const std::vector<CameraFrame> follow{at(0.0), at(0.2)}, sightline{at(0.7), at(0.9)};
  const Picture whole = comparison(*world_, follow, sightline, kWidth);
  const Picture panel = draw_frame(*world_, follow[0], kWidth);
  EXPECT_EQ(whole.width, 2 * panel.width + 4);
  const int label = whole.height / 2 - panel.height;
  EXPECT_EQ(whole.height, 2 * (label + panel.height));
  for (int k = 0; k < 2; ++k) {
    const int left = k * (panel.width + 4);
    EXPECT_TRUE(holds(whole, draw_frame(*world_, follow[static_cast<size_t>(k)], kWidth), left, label)) << k;
    EXPECT_TRUE(holds(whole, draw_frame(*world_, sightline[static_cast<size_t>(k)], kWidth), left, whole.height / 2 + label)) << k;
  }
  // Each row has a label in white, a few pixels from the left edge.
  for (const int top : {0, whole.height / 2}) {
    int first = whole.width;
    for (int y = top; y < top + label; ++y)
      for (int x = 0; x < whole.width; ++x)
        if (whole.at(x, y) == Rgb{255, 255, 255}) first = std::min(first, x);
    EXPECT_GE(first, 4);
    EXPECT_LE(first, 14);
  }
}

}  // namespace
}  // namespace sightline
