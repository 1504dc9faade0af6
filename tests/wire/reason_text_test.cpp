// The sentence that says why the camera moves.
#include "server/wire/reason_text.h"

#include <gtest/gtest.h>

namespace sightline::test {
namespace {

// Flies a plan, away from its shot.
StepResult away_from_shot() {
  StepResult result;
  result.reason = MoveReason::kBestAllVisible;
  result.shot.emplace();
  result.shot->deviation.height = 0.5;
  result.courses.taken = FlightCourse::kPlan;
  return result;
}
const std::string kBest = "going to the position with the best view of all targets, now and soon";

TEST(ReasonText, NamesWhatHidesATarget) {
  StepResult result = away_from_shot();
  result.shot->hidden_by = 7, result.shot->hidden_target = 2;
  EXPECT_EQ(reason_text(result), kBest + "; instance 7 hides target 2 from the place of the shot");
}

TEST(ReasonText, NamesWhatWillHideATarget) {
  StepResult result = away_from_shot();
  result.shot->soon_by = 7, result.shot->soon_target = 2, result.shot->soon_s = 0.43;
  EXPECT_EQ(reason_text(result),
            kBest + "; instance 7 is expected to hide target 2 from the place of the shot in 0.4 s");
  result.shot->soon_s = 0.97;
  EXPECT_EQ(reason_text(result),
            kBest + "; instance 7 is expected to hide target 2 from the place of the shot in 1.0 s");
  result.shot->soon_s = 0.02;
  EXPECT_EQ(reason_text(result), kBest + "; instance 7 is about to hide target 2 from the place of the shot");
  result.shot->hidden_by = 8, result.shot->hidden_target = 1;
  EXPECT_EQ(reason_text(result), kBest + "; instance 8 hides target 1 from the place of the shot")
      << "what is so comes before what will be";
}

TEST(ReasonText, NamesTheLimitThatTheShotBreaks) {
  StepResult result = away_from_shot();
  result.shot->limits = 1u << static_cast<int>(ShotLimit::kMaxElevation);
  EXPECT_EQ(reason_text(result), kBest + "; max_elevation_rad keeps it from the place of the shot");
  result.shot->limits = 1u << static_cast<int>(ShotLimit::kPicture);
  EXPECT_EQ(reason_text(result), kBest + "; the picture cannot hold all targets from the place of the shot");
}

TEST(ReasonText, SaysWhatTheShotWouldLose) {
  StepResult result = away_from_shot();
  result.courses.follow_loss = 0.31, result.courses.plan_loss = 0.04;
  EXPECT_EQ(reason_text(result), kBest + "; following is expected to lose 30 % in the coming second, this course 0 %");
  result.courses.follow_loss = 1.7;
  EXPECT_EQ(reason_text(result), kBest + "; following is expected to lose 100 % in the coming second, this course 0 %");
  result.courses.plan_loss = 1.3;
  EXPECT_EQ(reason_text(result), kBest) << "the one loses no less than the other";
  result.courses.follow_loss = 0.07, result.courses.plan_loss = 0.06;
  EXPECT_EQ(reason_text(result), kBest) << "that is not why";
  result.courses.follow_loss.reset();
  EXPECT_EQ(reason_text(result), kBest) << "no way leads to the shot";
}

TEST(ReasonText, OfACameraThatKeepsItsShotIsTheReasonAlone) {
  StepResult result = away_from_shot();
  result.shot->soon_by = 7, result.shot->soon_target = 2, result.shot->soon_s = 0.4;
  for (const MoveReason reason : {MoveReason::kAtDesiredPlace, MoveReason::kPaused, MoveReason::kBodyOverlap}) {
    result.reason = reason;
    EXPECT_EQ(reason_text(result), explain(reason));
  }
  result.reason = MoveReason::kAtDesiredPlace;
  result.shot.reset();
  EXPECT_EQ(reason_text(result), explain(MoveReason::kAtDesiredPlace));
}

}  // namespace
}  // namespace sightline::test
