// The table of open sessions, with answers made by hand and sums taken by hand.
#include "server/service/session_table.h"

#include <gtest/gtest.h>

namespace sightline {
namespace {

struct Shown {
  double filtered = 1.0, in_picture = 1.0;
};

SessionAnswer answer(TrackingStatus status, double moved_s, std::initializer_list<Shown> targets = {}) {
  SessionAnswer made;
  made.moved_s = moved_s;
  made.step.status = status;
  for (const Shown& shown : targets) {
    TargetSight sight;
    sight.filtered_share = shown.filtered, sight.picture_share = shown.in_picture;
    made.step.targets.push_back(sight);
  }
  return made;
}

Target target(bool required, double weight) {
  Target made;
  made.required = required, made.weight = weight;
  return made;
}

double time_s(const CameraSums& sums, TrackingStatus status) {
  return sums.status_s[static_cast<size_t>(status)];
}

TEST(SessionTable, AddsTheTimeOfEachStepToItsStatus) {
  SessionTable table;
  const auto place = table.open("a", "label", "client", 5);
  place->add(answer(TrackingStatus::kTracking, 0.25), {}, 0);
  place->add(answer(TrackingStatus::kLost, 0.125), {}, 0);
  place->add(answer(TrackingStatus::kTracking, 0.5), {}, 0);
  place->add(answer(TrackingStatus::kTracking, 0.0), {}, 0);  // paused
  const SessionRow row = table.rows().at(0);
  EXPECT_EQ(row.id + row.label + row.client, "alabelclient");
  EXPECT_EQ(row.opened_ns, 5);
  EXPECT_EQ(row.steps, 4u);
  EXPECT_DOUBLE_EQ(time_s(row.sums, TrackingStatus::kTracking), 0.75);
  EXPECT_DOUBLE_EQ(time_s(row.sums, TrackingStatus::kLost), 0.125);
  EXPECT_DOUBLE_EQ(time_s(table.sums(), TrackingStatus::kTracking), 0.75);
}

TEST(SessionTable, RequiredTargetsCountOrAllIfNoneIsRequired) {
  SessionTable table;
  const auto place = table.open("a", "", "", 0);
  const auto seen = answer(TrackingStatus::kTracking, 0.5, {{0.5, 0.5}, {1.0, 0.25}, {1.0, 1.0}});
  place->add(seen, {target(true, 1), target(false, 9), target(true, 0)}, 0);
  EXPECT_DOUBLE_EQ(table.sums().target_s, 0.5) << "the second is optional, the third has no weight";
  EXPECT_DOUBLE_EQ(table.sums().shown_s, 0.5 * 0.25);
  place->add(seen, {target(false, 1), target(false, 9), target(false, 0)}, 0);
  EXPECT_DOUBLE_EQ(table.sums().target_s, 0.5 + 2 * 0.5);
  EXPECT_DOUBLE_EQ(table.sums().shown_s, 0.5 * 0.25 + 0.5 * (0.25 + 0.25));
}

TEST(SessionTable, AShotIsKeptWithinItsFreeBandsAndPicturesCountByTheirWorth) {
  SessionTable table;
  const auto place = table.open("a", "", "", 0);
  SessionAnswer made = answer(TrackingStatus::kTracking, 0.25);
  made.step.shot.emplace().worth = 0.5;
  made.step.shot->deviation.place = 0.7;  // it has no part in what is kept
  place->add(made, {}, 0);
  made.step.shot->deviation.height = 0.01;
  place->add(made, {}, 0);
  made.step.shot.reset();
  made.step.cut = true;
  place->add(made, {}, 0);
  EXPECT_DOUBLE_EQ(table.sums().shot_s, 0.5);
  EXPECT_DOUBLE_EQ(table.sums().shot_kept_s, 0.25);
  EXPECT_DOUBLE_EQ(table.sums().worth_s, 0.25);
  EXPECT_EQ(table.sums().cuts, 1u);
}

TEST(SessionTable, ASessionIsBlindFromItsFirstStepWithoutASightUntilOneWith) {
  SessionTable table;
  const auto place = table.open("a", "", "", 0);
  EXPECT_EQ(table.now(0).by_status, (SessionTable::Now{}.by_status)) << "it has had no step";
  for (const TrackingStatus status :
       {TrackingStatus::kSeeking, TrackingStatus::kBlocked, TrackingStatus::kWaiting, TrackingStatus::kLost}) {
    EXPECT_EQ(table.now(0).blind, 0u);
    place->add(answer(status, 0.5), {}, 0);
  }
  EXPECT_DOUBLE_EQ(table.rows()[0].blind_s, 2.0);
  EXPECT_EQ(table.now(0).blind, 1u);
  EXPECT_EQ(table.now(0).by_status[static_cast<size_t>(TrackingStatus::kLost)], 1u);
  place->add(answer(TrackingStatus::kPartialView, 0.5), {}, 0);
  EXPECT_EQ(table.rows()[0].blind_s, 0.0);
  EXPECT_EQ(table.now(0).blind, 0u);
  place->add(answer(TrackingStatus::kHolding, 9.0), {}, 0);
  EXPECT_EQ(table.rows()[0].blind_s, 0.0) << "there is nobody to see";
}

constexpr int64_t ns(double seconds) {
  return static_cast<int64_t>(seconds * 1e9);
}

TEST(SessionTable, TheLongestBlindSessionIsToldWhileItsGameGoesOn) {
  SessionTable table;
  const auto seeing = table.open("seeing", "", "", 0), blind = table.open("blind", "", "", 0),
             longer = table.open("longer", "", "", 0);
  EXPECT_EQ(table.now(0).longest_blind_s, 0.0);
  seeing->add(answer(TrackingStatus::kTracking, 0.25), {}, ns(1));
  EXPECT_EQ(table.now(ns(1)).longest_blind_s, 0.0);
  blind->add(answer(TrackingStatus::kLost, 0.125), {}, ns(1));
  EXPECT_DOUBLE_EQ(table.now(ns(1)).longest_blind_s, 0.125) << "from the first step on";
  for (int i = 0; i < 4; ++i) longer->add(answer(TrackingStatus::kBlocked, 0.25), {}, ns(2));
  EXPECT_DOUBLE_EQ(table.now(ns(2)).longest_blind_s, 1.0);
  longer->add(answer(TrackingStatus::kWaiting, 0.0), {}, ns(6));  // paused
  EXPECT_DOUBLE_EQ(table.now(ns(5.9)).longest_blind_s, 1.0);
  EXPECT_DOUBLE_EQ(table.now(ns(7)).longest_blind_s, 0.0) << "neither has had a step that moves for 5 s";
  blind->add(answer(TrackingStatus::kLost, 0.25), {}, ns(8));
  EXPECT_DOUBLE_EQ(table.now(ns(8)).longest_blind_s, 0.375);
  longer->add(answer(TrackingStatus::kLost, 0.25), {}, ns(9));
  EXPECT_DOUBLE_EQ(table.now(ns(9)).longest_blind_s, 1.25) << "it goes on where it stood";
  longer->add(answer(TrackingStatus::kPartialView, 0.25), {}, ns(9));
  EXPECT_DOUBLE_EQ(table.now(ns(9)).longest_blind_s, 0.375);
}

TEST(SessionTable, RowsAreInTheOrderOfTheirOpeningAndBeginAfterANumber) {
  SessionTable table;
  const auto a = table.open("a", "", "", 0);
  auto b = table.open("b", "", "", 0);
  const auto c = table.open("c", "", "", 0);
  const auto ids = [&](uint64_t after, size_t at_most) {
    std::string text;
    for (const SessionRow& row : table.rows(after, at_most)) text += row.id;
    return text;
  };
  EXPECT_EQ(ids(0, 2), "ab");
  EXPECT_EQ(ids(table.rows()[1].number, 2), "c");
  EXPECT_EQ(ids(table.rows()[2].number, 2), "");
  const uint64_t gone = table.rows()[1].number;
  b.reset();
  const auto d = table.open("d", "", "", 0);
  EXPECT_EQ(ids(gone, 9), "cd") << "the session that a page ended with may have ended itself";
  EXPECT_EQ(ids(0, 9), "acd");
}

TEST(SessionTable, ASessionThatEndsLeavesItsSumsAndNotItsRow) {
  SessionTable table;
  const auto stays = table.open("stays", "", "", 0);
  {
    const auto ends = table.open("ends", "", "", 0);
    ends->add(answer(TrackingStatus::kTracking, 0.25), {}, 0);
    EXPECT_EQ(table.rows().size(), 2u);
  }
  ASSERT_EQ(table.rows().size(), 1u);
  EXPECT_EQ(table.rows()[0].id, "stays");
  EXPECT_DOUBLE_EQ(time_s(table.sums(), TrackingStatus::kTracking), 0.25);
}

}  // namespace
}  // namespace sightline
