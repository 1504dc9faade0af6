// The camera moves before a target is hidden, because its flight plan knows from where the target will be seen.
#include <gtest/gtest.h>

#include "tests/support/filming.h"

namespace sightline::test {
namespace {

// A target that walks round the end of a high wall, seen from above:
//
//   camera   target ->        |
//                             | then it goes back behind the wall
//   ===========================
//
struct RoundACorner : OneFilmed {
  RoundACorner() : OneFilmed({0, 1.8, 5}) {
    add_box(9, {0, -0.5, 0}, {60, 0.5, 60});
    add_box(10, {0, 15, -1.5}, {8.0, 15, 0.2});
    settings.move.max_elevation_rad = 0.6;  // it cannot look over the wall
    settings.move.search_viewpoints = false;
  }
  // 3 m/s along the wall, round its end, and back on its other side.
  glm::dvec3 target_m(double time_s) const {
    const double way_m = 3.0 * time_s;
    if (way_m < 9.2) return {way_m, 1, 0};
    if (way_m < 12.2) return {9.2, 1, 9.2 - way_m};
    return {std::max(9.2 - (way_m - 12.2), 4.0), 1, -3.0};
  }
  int hidden_steps() {
    int hidden = 0;
    Watch watch(*this);
    StepResult r;
    for (int i = 0; i < 420; ++i) {
      const double time_s = i / 60.0;
      move(1, target_m(time_s), (target_m(time_s) - target_m(time_s - 1.0 / 60)) * 60.0);
      step_in(watch, r);
      hidden += r.targets[0].visible_share < 0.5;
    }
    return hidden;
  }
};

TEST(Anticipation, TheTargetIsSeenRoundACorner) {
  EXPECT_EQ(RoundACorner().hidden_steps(), 0);
}

TEST(Anticipation, IsWorthMoreThanAnswering) {
  RoundACorner answers;
  answers.settings.move.prediction_s = 0;
  EXPECT_GT(answers.hidden_steps(), RoundACorner().hidden_steps() + 6) << "without a prediction it comes too late";
}

}  // namespace
}  // namespace sightline::test
