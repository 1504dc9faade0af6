// How soon a camera shows new targets as asked, on runs whose answers are known.
#include "client/truth/changes.h"

#include <gtest/gtest.h>

namespace sightline {
namespace {

// A run of ten frames a second with a picture at each second one; everything is as asked until a test says otherwise.
struct Played {
  explicit Played(size_t count) : frames(count), shots(count), truths(count) {
    for (size_t i = 0; i < count; ++i) {
      frames[i].time_s = 0.1 * static_cast<double>(i);
      if (i % 2 == 0) truths[i].picture = picture(1.0);
    }
  }
  static PictureTruth picture(double inside) {
    PictureTruth picture;
    picture.targets.push_back(
        {.id = 1, .alone_pixels = 100, .visible_pixels = 100, .outline = {.in_picture_share = inside}});
    return picture;
  }
  ChangeMetrics measure() const { return answers_to_changes(frames, shots, truths); }

  std::vector<CameraFrame> frames;
  std::vector<FrameShot> shots;
  std::vector<FrameTruth> truths;
};

TEST(Changes, NoneWithoutOne) {
  const ChangeMetrics metrics = Played(10).measure();
  EXPECT_EQ(metrics.changes, 0u);
  EXPECT_EQ(metrics.mean_answer_s, 0);
}

TEST(Changes, AreAnsweredByTheFirstPictureThatShowsTheTargetsWholeInTheShot) {
  Played run(40);
  run.truths[10].other_targets = true;
  for (size_t i = 10; i < 16; ++i) run.shots[i].now.height_rad = 1.0;                // from above
  for (size_t i = 16; i < 20; i += 2) run.truths[i].picture = Played::picture(0.9);  // cut off
  run.truths[30].other_targets = true;                                               // answered at once
  const ChangeMetrics metrics = run.measure();
  EXPECT_EQ(metrics.changes, 2u);
  EXPECT_EQ(metrics.unanswered, 0u);
  EXPECT_NEAR(metrics.longest_answer_s, 1.0, 1e-9) << "from frame 10 to frame 20";
  EXPECT_NEAR(metrics.mean_answer_s, 0.5, 1e-9);
}

TEST(Changes, CountUpToTheNextOneOrToTheEnd) {
  Played run(40);
  run.truths[10].other_targets = run.truths[20].other_targets = true;
  for (size_t i = 10; i < 40; ++i) run.shots[i].now.side_rad = 3.0;
  const ChangeMetrics metrics = run.measure();
  EXPECT_EQ(metrics.changes, 2u);
  EXPECT_EQ(metrics.unanswered, 2u);
  EXPECT_NEAR(metrics.longest_answer_s, 1.9, 1e-9);
  EXPECT_NEAR(metrics.mean_answer_s, (0.9 + 1.9) / 2, 1e-9);
}

}  // namespace
}  // namespace sightline
