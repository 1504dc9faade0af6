// A policy's status, and the stretches in which it sees no target, on pictures made up by hand.
#include "client/truth/reports.h"

#include <gtest/gtest.h>

#include "client/truth/blindness.h"
#include "client/truth/metrics.h"

namespace sightline {
namespace {

constexpr uint64_t kAnna = 1, kBen = 2;

// A judged picture in which 100 pixels of each target would show and `anna` and `ben` of them do.
FrameTruth picture(uint32_t anna, uint32_t ben) {
  FrameTruth truth;
  truth.picture.emplace();
  truth.picture->targets = {{kAnna, 100, anna, true}, {kBen, 100, ben, true}};
  return truth;
}

// ---- shares ----

TEST(ReportsAgainstTruth, OneHalfIsVisibleAsReportedAndInTruth) {
  const std::vector<std::vector<ReportedShare>> reports{{{kAnna, 0.5, 0.499}, {kBen, 0.499, 0.5}}};
  const ReportMetrics seen = judge_reports(std::vector{picture(50, 50)}, reports);
  EXPECT_EQ(seen.pairs, 2u);
  EXPECT_EQ(seen.hidden_pairs, 0u);
  for (const ReportErrors& errors : {seen.visible, seen.filtered}) {
    EXPECT_EQ(errors.false_visible, 0.0);
    EXPECT_EQ(errors.false_occluded, 0.5);
    EXPECT_NEAR(errors.mean_absolute_error, 0.0005, 1e-12);
  }
  const ReportMetrics hidden = judge_reports(std::vector{picture(49, 49)}, reports);
  EXPECT_EQ(hidden.hidden_pairs, 2u);
  for (const ReportErrors& errors : {hidden.visible, hidden.filtered}) {
    EXPECT_EQ(errors.false_visible, 0.5);
    EXPECT_EQ(errors.false_occluded, 0.0);
  }
}

TEST(ReportsAgainstTruth, ATargetWithoutPixelsOrWithoutAReportIsNoPair) {
  std::vector<FrameTruth> truths{picture(100, 100)};
  truths[0].picture->targets[1] = {kBen, 0, 0, false};
  EXPECT_EQ(judge_reports(truths, std::vector<std::vector<ReportedShare>>{{{kAnna, 1, 1}, {kBen, 1, 1}}}).pairs, 1u);
  EXPECT_EQ(judge_reports(truths, std::vector<std::vector<ReportedShare>>{{{kBen, 1, 1}}}).pairs, 0u);
}

// ---- status ----

TEST(StatusAgainstTruth, SharesAreOfThePicturesWithAStatus) {
  const std::vector<FrameTruth> truths{picture(100, 100), picture(0, 0), picture(0, 0),    picture(0, 0),
                                       FrameTruth{},      picture(0, 0), picture(40, 100), picture(40, 100)};
  const std::vector<std::optional<bool>> tracking{true, true, true, false, true, std::nullopt, true, false};
  const std::vector<uint64_t> both{kAnna, kBen};
  const StatusMetrics metrics = judge_status(truths, tracking, both);
  EXPECT_EQ(metrics.pictures, 6u) << "one frame has no picture, and one no status";
  EXPECT_DOUBLE_EQ(metrics.tracking_while_lost, 2.0 / 6);
  EXPECT_DOUBLE_EQ(metrics.lost_called_tracking, 2.0 / 3);
  EXPECT_DOUBLE_EQ(metrics.tracking_while_half_hidden, 3.0 / 6);
}

TEST(StatusAgainstTruth, OnlyRequiredTargetsMustBeHalfVisible) {
  const std::vector<FrameTruth> truths{picture(49, 100), picture(50, 100), picture(100, 49), picture(100, 100)};
  const std::vector<std::optional<bool>> tracking(4, true);
  const std::vector<uint64_t> anna{kAnna}, both{kAnna, kBen};
  EXPECT_DOUBLE_EQ(judge_status(truths, tracking, anna).tracking_while_half_hidden, 0.25);
  EXPECT_DOUBLE_EQ(judge_status(truths, tracking, both).tracking_while_half_hidden, 0.5);
  EXPECT_DOUBLE_EQ(judge_status(truths, tracking, {}).tracking_while_half_hidden, 0.0);
}

TEST(StatusAgainstTruth, ATargetOutsideThePictureIsNotVisible) {
  std::vector<FrameTruth> truths{picture(100, 100)};
  truths[0].picture->targets[1] = {kBen, 0, 0, false};
  const std::vector<uint64_t> both{kAnna, kBen};
  const std::vector<std::optional<bool>> tracking{true};
  const StatusMetrics metrics = judge_status(truths, tracking, both);
  EXPECT_DOUBLE_EQ(metrics.tracking_while_half_hidden, 1.0);
  EXPECT_DOUBLE_EQ(metrics.tracking_while_lost, 0.0);
}

TEST(StatusAgainstTruth, NothingToCountGivesZeroes) {
  const std::vector<FrameTruth> truths{FrameTruth{}};
  const std::vector<std::optional<bool>> tracking{true};
  const StatusMetrics metrics = judge_status(truths, tracking, {});
  EXPECT_EQ(metrics.pictures, 0u);
  EXPECT_EQ(metrics.lost_called_tracking, 0.0);
}

// ---- no target seen ----

struct Judged {
  std::vector<CameraFrame> frames;
  std::vector<FrameTruth> truths;
};

// One letter a frame, 0.1 s apart: b: no target is seen; s: a target is seen; '-': no picture was judged.
Judged run_of(const std::string& letters) {
  Judged run;
  for (const char letter : letters) {
    CameraFrame frame;
    frame.time_s = 0.1 * static_cast<double>(run.frames.size());
    run.frames.push_back(frame);
    run.truths.push_back(letter == '-' ? FrameTruth{} : letter == 'b' ? picture(0, 0) : picture(0, 1));
  }
  return run;
}

double longest_blind_s(const std::string& letters) {
  const Judged run = run_of(letters);
  return summarize(std::vector<TargetMetrics>{}, run.frames, run.truths, CameraLimits{}).longest_blind_s;
}

TEST(BlindStretches, LastUntilTheNextPictureWithAPixel) {
  EXPECT_NEAR(longest_blind_s("ssbbss"), 0.2, 1e-9);
  EXPECT_NEAR(longest_blind_s("bssbbbs"), 0.3, 1e-9) << "the longest";
  EXPECT_NEAR(longest_blind_s("s--b--b--s--"), 0.6, 1e-9) << "frames without a picture say nothing";
  EXPECT_EQ(longest_blind_s("ssss"), 0.0);
  EXPECT_EQ(longest_blind_s("----"), 0.0);
  EXPECT_EQ(longest_blind_s(""), 0.0);
}

TEST(BlindStretches, OneAtTheEndLastsToTheLastPicture) {
  EXPECT_NEAR(longest_blind_s("ssbbb"), 0.2, 1e-9);
  EXPECT_NEAR(longest_blind_s("ssbbb--"), 0.2, 1e-9);
}

TEST(BlindStretches, AreListedInTheOrderOfTime) {
  const Judged run = run_of("bb-s-b-bs-b");
  const auto stretches = blind_stretches(run.frames, run.truths);
  ASSERT_EQ(stretches.size(), 3u);
  EXPECT_EQ(stretches[0].first, 0u);
  EXPECT_EQ(stretches[0].end, 3u);
  EXPECT_EQ(stretches[1].first, 5u);
  EXPECT_EQ(stretches[1].end, 8u);
  EXPECT_EQ(stretches[2].first, 10u);
  EXPECT_EQ(stretches[2].end, 10u);
}

}  // namespace
}  // namespace sightline
