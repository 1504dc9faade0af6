// The page of a drive that was played in this process, against the drive.
#include "client/drive/page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>

#include "client/base/text_table.h"
#include "client/recordings/local_session.h"
#include "client/scenario/scenario_session.h"
#include "server/sample/embree_sampler.h"
#include "tests/support/small_scenes.h"

namespace sightline {
namespace {

using testing::Contains;
using testing::Each;
using testing::ElementsAre;
using testing::Field;
using testing::SizeIs;

using Fact = std::pair<std::string, std::string>;

uint64_t now_ns() {
  return static_cast<uint64_t>(std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1));
}

// Eleven ticks at 10 Hz; every other one is merged into the next, so that six replies come. Every other reply has a
// picture's truth.
class DrivePageTest : public testing::Test {
 protected:
  DrivePageTest() {
    const auto asset = world_.scenes.add_uploaded(file_);
    scenario_.emplace(*Scenario::from_asset(*asset));
    open_ = open_request(*scenario_, to_hex((*asset)->hash), 7);
    play_.rate_hz = 10.0, play_.duration_s = 1.0, play_.lockstep = true;
    const auto session = LocalSession::open(open_, world_);
    opened_ = (*session)->opened();
    opened_.set_session_id("the-session");
    opened_.set_sampler("embree");
    for (size_t k = 0; k < tick_count(play_); ++k) {
      v1::TickError rejection;
      EXPECT_TRUE((*session)->apply(played_tick(*scenario_, play_, k), rejection)) << rejection.message();
      if (k % 2 == 0) step(**session);
    }
    run_.pictures = 3, run_.r_n = 0.125;
    run_.targets = {{.id = 1, .name = "anna"}, {.id = 2, .name = "ben"}};
  }
  void step(LocalSession& session) {
    const size_t i = frames_.size();
    PlayedFrame& frame = frames_.emplace_back();
    EXPECT_TRUE(session.step(0, frame.reply).has_value());
    frame.received_s = 0.05 + 0.2 * static_cast<double>(i);
    frame.latency_ms = 5.0 + static_cast<double>(i);
    FrameTruth& truth = truths_.emplace_back();
    truth.body.clearance_m = 1.0f + static_cast<float>(i);
    if (i % 2 == 0)
      truth.picture.emplace().targets = {{2, 200, 150, true}, {1, 100, 25 + static_cast<uint32_t>(i), true}};
  }
  SessionPage page() {
    const auto made = drive_page({*scenario_, file_, open_, opened_, play_, frames_, truths_, run_, follow_}, "a title",
                                 [this](const char*, size_t, size_t) { ++told_; });
    EXPECT_TRUE(made.has_value()) << to_string(made.error());
    return *made;
  }

  const std::vector<std::byte>
      file_ = test::SmallScene(1.0, {0, 1, 8}).target("anna", {-1.5, 0, 0}).target("ben", {1.5, 0, 0}).write();
  const std::unique_ptr<SamplerDevice> sampler_ = make_embree_sampler_device();
  LocalWorld world_{"", *sampler_};
  std::optional<Scenario> scenario_;
  v1::OpenSession open_;
  v1::SessionOpened opened_;
  PlayOptions play_;
  std::vector<PlayedFrame> frames_;
  std::vector<FrameTruth> truths_;
  RunMetrics run_;
  std::optional<RunMetrics> follow_;
  size_t told_ = 0;  // calls of the progress function
};

TEST_F(DrivePageTest, HasAFrameForEachReplyWithItsTruth) {
  const SessionPage made = page();
  ASSERT_EQ(made.frames.size(), 6u);
  ASSERT_EQ(made.targets.size(), 2u);
  for (size_t i = 0; i < 6; ++i) {
    const PageFrame& frame = made.frames[i];
    EXPECT_EQ(frame.sequence, 2 * i + 1);
    EXPECT_EQ(frame.clearance_m, 1.0 + static_cast<double>(i));
    EXPECT_NEAR(frame.latency_ms, 5.0 + static_cast<double>(i), 1e-3);
    for (size_t k = 0; k < 2; ++k) {
      const double share = made.targets[k].name == "anna" ? 0.25 + 0.01 * static_cast<double>(i) : 0.75;
      if (i % 2 == 0) {
        EXPECT_NEAR(frame.sights[k].true_share, share, 1e-12) << i;
      } else {
        EXPECT_TRUE(std::isnan(frame.sights[k].true_share)) << i << ": no picture was judged there";
      }
    }
  }
  EXPECT_GT(told_, 0u);
}

TEST_F(DrivePageTest, TellsTheFactsOfTheDrive) {
  const uint64_t before_ns = now_ns();
  const SessionPage made = page();
  EXPECT_EQ(made.title, "a title");
  for (const Fact& fact :
       {Fact("ticks", "11"), Fact("replies", "6"), Fact("refused", "0"), Fact("session", "the-session"),
        Fact("label", "a title"), Fact("sampler", "embree"), Fact("seed", "7"), Fact("part", "1"),
        Fact("instances", std::to_string(opened_.instance_count())),
        Fact("triangles", std::to_string(opened_.triangle_count())), Fact("rate", "10 Hz, as fast as replies come")})
    EXPECT_THAT(made.facts, Contains(fact));
  EXPECT_GT(opened_.triangle_count(), 0u);
  // The play began 1.05 s before its last reply, which is taken to have come just now.
  const auto start = std::find_if(made.facts.begin(), made.facts.end(),
                                  [](const Fact& fact) { return fact.first == "start"; });
  ASSERT_NE(start, made.facts.end());
  EXPECT_GE(start->second, utc_text(before_ns - 1'050'000'000));
  EXPECT_LE(start->second, utc_text(now_ns() - 1'050'000'000));
  play_.lockstep = false;
  EXPECT_THAT(page().facts, Contains(Fact("rate", "10 Hz, in real time")));
}

TEST_F(DrivePageTest, EveryFigureHasAValueForEachColumn) {
  const auto values = [](const SessionPage& made, const std::string& label) {
    for (const FigureRow& row : made.figures)
      if (row.label == label) return row.values;
    return std::vector<std::string>{"no figure " + label};
  };
  const SessionPage alone = page();
  EXPECT_THAT(alone.columns, ElementsAre("sightline"));
  EXPECT_THAT(alone.figures, Each(Field(&FigureRow::values, SizeIs(1))));
  EXPECT_THAT(values(alone, "r_N (no target visible)"), ElementsAre("12.5 %"));
  EXPECT_THAT(values(alone, "replies"), ElementsAre("6"));
  follow_ = run_;
  follow_->r_n = 0.5;
  const SessionPage both = page();
  EXPECT_THAT(both.columns, ElementsAre("sightline", "follow"));
  EXPECT_THAT(both.figures, Each(Field(&FigureRow::values, SizeIs(2))));
  EXPECT_THAT(values(both, "r_N (no target visible)"), ElementsAre("12.5 %", "50.0 %"));
  EXPECT_THAT(values(both, "replies"), ElementsAre("6", "")) << "replies are known of the run alone";
  EXPECT_EQ(both.figures.size(), alone.figures.size());
}

}  // namespace
}  // namespace sightline
