// The bytes of a session's memory: another session goes on from them, and answers with the same bits.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "tests/session/game.h"

namespace sightline::test {
namespace {

constexpr int kBefore = 45, kAfter = 40;
constexpr double kTickS = 1.0 / 64;
using Settings = std::function<void(StepSettings&)>;

// Two people walk in a bend while a wall goes to and fro before them, so that they are seen and hidden in turns.
SessionAnswer play(Game& game, int i) {
  const double time_s = i * kTickS;
  TickMaker tick = game.tick(kTickS);
  tick.move(kAnn, {-1 + std::sin(time_s), 1, -time_s}).move(kBob, {1 + std::sin(time_s), 1, -time_s});
  tick.move(kWall, {std::sin(19 * time_s), 1, 3 - time_s});
  return game.play(tick);
}

struct Reply {
  glm::dvec3 position_m;
  glm::dquat rotation;
  std::vector<double> shares;
  std::vector<uint32_t> filtered;
  bool operator==(const Reply&) const = default;
};

Reply reply_of(const Game& game, const SessionAnswer& answer) {
  Reply reply{answer.step.camera.pose.position_m, answer.step.camera.pose.rotation, {}, {}};
  for (const auto& target : answer.step.targets) reply.shares.push_back(target.filtered_share);
  reply.filtered = game.session->dump().sights.candidates.filtered_targets;
  return reply;
}

// Plays on from the memory after `kBefore` ticks, and compares with the session that went on. Returns in how many ticks the filter, and so the
// history, made a difference.
int expect_same_after_resume(const Settings& change) {
  const auto options = [&](SessionOptions& o) { change(o.settings); };
  Game first(options), second(options);
  for (int i = 1; i <= kBefore; ++i) play(first, i);
  std::string memory;
  first.session->write_memory(memory);
  const Status resumed = second.session->resume(Session::memory_layout(), memory);
  EXPECT_TRUE(resumed.has_value());
  second.sequence = first.sequence, second.time_s = first.time_s;
  int filtered = 0;
  for (int i = kBefore + 1; i <= kBefore + kAfter; ++i) {
    const Reply expected = reply_of(first, play(first, i));
    EXPECT_EQ(reply_of(second, play(second, i)), expected) << "tick " << i;
    filtered += expected.filtered != first.session->dump().sights.candidates.visible_targets;
  }
  return filtered;
}

TEST(SessionMemory, KeepsTheHistoryOfTheFilters) {
  for (const FilterMode mode : {FilterMode::kJoint, FilterMode::kPerTarget}) {
    const int filtered = expect_same_after_resume([&](StepSettings& settings) {
      settings.aggregate.filter.mode = mode;
      settings.aggregate.filter.n = 32;
      settings.aggregate.filter.window_s = 0.5;
    });
    EXPECT_GT(filtered, kAfter / 2);
  }
}

TEST(SessionMemory, KeepsAllThatTheDefaultRemembers) {
  expect_same_after_resume([](StepSettings& settings) { settings = preset_settings(Preset::kSightline); });
}

TEST(SessionMemory, DamagedBytesAreRefused) {
  Game first, second;
  for (int i = 1; i <= 3; ++i) play(first, i);
  std::string memory;
  first.session->write_memory(memory);
  const auto refused = [&](uint64_t layout, std::string_view bytes) {
    const Status status = second.session->resume(layout, bytes);
    return !status && status.error().code == ErrorCode::kInvalidArgument && status.error().field == "memory";
  };
  EXPECT_TRUE(refused(Session::memory_layout() + 1, memory));
  EXPECT_TRUE(refused(Session::memory_layout(), std::string_view(memory).substr(0, memory.size() - 1)));
  EXPECT_TRUE(refused(Session::memory_layout(), memory + '\0'));
  EXPECT_TRUE(second.session->resume(Session::memory_layout(), memory).has_value());
}

}  // namespace
}  // namespace sightline::test
