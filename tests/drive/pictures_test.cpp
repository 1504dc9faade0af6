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

// The far edge of the floor is 28 m away and 1 m below the camera: at row 49.4 of 90, for a lens of 40 degrees.
TEST_F(PicturesTest, EveryPixelShowsWhatIsThere) {
  const Picture picture = draw_frame(*world_, at(0.0), kWidth);
  ASSERT_EQ(picture.height, 90);
  for (const Rgb& pixel : picture.pixels) EXPECT_NE(pixel, (Rgb{0, 0, 0})) << "no pixel was left out";
  constexpr int kMiddle = kWidth / 2;  // between the two people
  const Rgb sky = picture.at(kMiddle, 40);
  for (int y = 40; y < 49; ++y) EXPECT_EQ(picture.at(kMiddle, y), sky) << y;
  EXPECT_NE(picture.at(kMiddle, 49), sky) << "half of it is floor";
  EXPECT_NE(picture.at(kMiddle, 50), picture.at(kMiddle, 49));
  EXPECT_GT(picture.at(kMiddle, 89)[0], 130) << "the floor is in the light";
}

TEST_F(PicturesTest, TheCaptionHasTheShareOfEachTargetInItsColour) {
  const Picture picture = draw_frame(*world_, at(0.0), kWidth);
  for (const Rgb& colour : {kFirst, kSecond}) {
    int pixels = 0;
    for (int y = 0; y < kCaption; ++y)
      for (int x = 0; x < picture.width; ++x) pixels += picture.at(x, y) == colour;
    EXPECT_GT(pixels, 50) << "100 % in its colour";
  }
}

TEST_F(PicturesTest, TheGroundOfTheCaptionIsDark) {
  const Picture picture = draw_frame(*world_, at(0.0), kWidth);
  const Rgb sky = picture.at(0, 1), dark = picture.at(4, 3);
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(dark[c], 0.3 * sky[c], 1.0);
  EXPECT_EQ(picture.at(0, 10), sky) << "nothing is written there";
}

// Through a long lens the body of one person fills the picture, so that its outline runs along the four edges.
TEST_F(PicturesTest, TheOutlineRunsAlongTheEdgesThatCutATarget) {
  CameraFrame close = at(0.0);
  close.camera.position_m = {-1.5, 1, 3};
  close.lens.vertical_fov_rad = 0.02;
  const Picture picture = draw_frame(*world_, close, kWidth);
  const int right = picture.width - 1, bottom = picture.height - 1;
  for (int x = 0; x <= right; ++x) {
    EXPECT_EQ(picture.at(x, 0), kFirst) << x;
    EXPECT_EQ(picture.at(x, bottom), kFirst) << x;
    if (x == 0 || x == right) continue;
    EXPECT_NE(picture.at(x, 1), kFirst) << x;
    EXPECT_NE(picture.at(x, bottom - 1), kFirst) << x;
  }
  for (int y = kCaption; y < bottom; ++y) {
    EXPECT_EQ(picture.at(0, y), kFirst) << y;
    EXPECT_EQ(picture.at(right, y), kFirst) << y;
    EXPECT_NE(picture.at(1, y), kFirst) << y;
    EXPECT_NE(picture.at(right - 1, y), kFirst) << y;
  }
}

// A hyphen is one upright rectangle, as high as the scale.
TEST(PictureText, HasTheSizeOfItsScaleAndIsCutAtTheEdges) {
  constexpr Rgb kInk{255, 255, 255};
  const auto ink = [&](const Picture& picture) {
    int rows = 0, columns = 0;
    for (int y = 0; y < picture.height; ++y) {
      int in_row = 0;
      for (int x = 0; x < picture.width; ++x) in_row += picture.at(x, y) == kInk;
      rows += in_row > 0, columns = std::max(columns, in_row);
    }
    return std::pair(columns, rows);
  };
  Picture once(40, 40), thrice(40, 40);
  draw_text(once, 2, 2, 1, "-", kInk), draw_text(thrice, 2, 2, 3, "-", kInk);
  EXPECT_EQ(ink(once).second, 1);
  EXPECT_EQ(ink(thrice).second, 3);
  EXPECT_EQ(ink(thrice).first, 3 * ink(once).first);
  EXPECT_EQ(text_width("a-b", 3), 3 * text_width("a-b", 1));
  for (const int at : {-4, 0, 36, 40}) {
    Picture cut(40, 40);
    draw_text(cut, at, at, 2, "M", kInk);
    EXPECT_LE(ink(cut).first, 14);
  }
}

TEST_F(PicturesTest, ASheetShowsEvenlySpacedFramesFromTheFirstToTheLast) {
  std::vector<CameraFrame> frames;
  for (int k = 0; k < 7; ++k) frames.push_back(at(k / 6.0));
  const Picture sheet = contact_sheet(*world_, frames, {.columns = 2, .rows = 2, .panel_width = kWidth});
  const Picture panel = draw_frame(*world_, frames[0], kWidth);
  EXPECT_EQ(sheet.width, 2 * (panel.width + 4) + 4);
  EXPECT_EQ(sheet.height, 2 * (panel.height + 4) + 4);
  for (int k = 0; k < 4; ++k)
    EXPECT_TRUE(holds(sheet, draw_frame(*world_, frames[static_cast<size_t>(2 * k)], kWidth),
                      4 + k % 2 * (panel.width + 4), 4 + k / 2 * (panel.height + 4)))
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
    EXPECT_TRUE(
        holds(whole, draw_frame(*world_, sightline[static_cast<size_t>(k)], kWidth), left, whole.height / 2 + label))
        << k;
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
