// The bytes of a session's memory: another session goes on from them, and answers with the same bits.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
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

// Plays on from the memory after `kBefore` ticks, and compares with the session that went on. Returns in how many ticks
// the filter, and so the history, made a difference.
int expect_same_after_resume(const Settings& change, const AskedShot& shot = {}) {
  const auto options = [&](SessionOptions& o) { change(o.settings), o.shot = shot; };
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

TEST(SessionMemory, KeepsThePairVolumesOfTheLastSteps) {
  for (const Strategy strategy : {Strategy::kBasic, Strategy::kRobust}) {
    const int filtered = expect_same_after_resume([&](StepSettings& settings) {
      settings = preset_settings(Preset::kPaper);
      settings.move.strategy = strategy;
      settings.aggregate.filter.n = 32;
    });
    EXPECT_GT(filtered, kAfter / 4);
  }
}

TEST(SessionMemory, KeepsAllThatTheDefaultRemembers) {
  for (const double decide_every_s : {0.0, 0.033, 0.1})  // the memory is written at a step that decides, or between two
    expect_same_after_resume([&](StepSettings& settings) {
      settings = preset_settings(Preset::kSightline);
      settings.move.decide_every_s = decide_every_s;
    });
}

// The second session gets what came and went in one tick, as a recording's snapshot tells it. The places of the
// instances, free ones too, are then those of the first, so that both put what is added later at the same places. In
// the middle of an orbit that begins with a blend, in a frame that turns with Ann.
TEST(SessionMemory, KeepsAShotThatMoves) {
  AskedShot shot;
  shot.number = 3;
  shot.subject_ids = {kAnn}, shot.frame = ShotFrame::kTravel, shot.frame_id = kAnn;
  shot.side_rad = 2.0, shot.size = 0.4, shot.orbit_radps = 0.5, shot.blend_s = 2;
  expect_same_after_resume([](StepSettings& settings) { settings = preset_settings(Preset::kSightline); }, shot);
}

// Ann's positions are held for two ticks, and Bob's are noisy. The session that goes on knows both at once.
TEST(SessionMemory, KeepsWhatIsKnownOfHeldAndNoisyPositions) {
  const auto options = [](SessionOptions& o) { o.settings = preset_settings(Preset::kSightline); };
  Game first(options), second(options);
  const auto tick_of = [](Game& game, int i) {
    const double noise_m = 0.02 * (i * 7919 % 13 - 6) / 6.0;
    return game.tick(kTickS).move(kAnn, {-1 + 0.05 * (i / 2), 1, 0}).move(kBob, {1 + noise_m, 1 - noise_m / 2, 0});
  };
  constexpr int kPlayed = 61;
  for (int i = 1; i <= kPlayed; ++i) first.play(tick_of(first, i));
  EXPECT_GT(glm::length(first.instance(kAnn).correction_m), 0.01);
  EXPECT_NE(first.instance(kBob).correction_m, glm::dvec3(0.0));
  std::string memory;
  first.session->write_memory(memory);
  const Status resumed = second.session->resume(Session::memory_layout(), memory);
  ASSERT_TRUE(resumed.has_value()) << to_string(resumed.error());
  second.sequence = first.sequence, second.time_s = first.time_s;
  EXPECT_EQ(second.instance(kAnn).center_m, first.instance(kAnn).center_m);
  for (int i = kPlayed + 1; i <= kPlayed + 30; ++i) {
    const Reply expected = reply_of(first, first.play(tick_of(first, i)));
    EXPECT_EQ(reply_of(second, second.play(tick_of(second, i))), expected) << "tick " << i;
    EXPECT_EQ(second.instance(kBob).correction_m, first.instance(kBob).correction_m);
  }
}

TEST(SessionMemory, KeepsThePlacesOfInstancesThatCameAndWent) {
  Game first, second;
  const auto box = [](Game& game, uint64_t id, double x) {
    return game.make(id, BoxShape{{0.1f, 0.1f, 0.1f}}, {x, 0.2, -2});
  };
  for (int i = 1; i <= 12; ++i) {
    TickMaker tick = first.tick(kTickS);
    if (i == 3) tick.delta.remove = {kCrate};
    if (i == 5) tick.delta.add = {box(first, 20, 1), box(first, 21, 2), box(first, 22, 3)};
    if (i == 7) tick.delta.remove = {20, 21};
    if (i == 9) tick.delta.add = {box(first, 23, 4)};
    first.play(tick.move(kAnn, {-1 + 0.01 * i, 1, 0}));
  }
  std::string memory;
  first.session->write_memory(memory);
  TickMaker all = second.tick(kTickS);
  all.delta.remove = {kCrate};
  all.delta.add = {box(second, 22, 3), box(second, 23, 4)};
  second.apply(all.move(kAnn, {-1 + 0.12, 1, 0}));
  const Status resumed = second.session->resume(Session::memory_layout(), memory);
  ASSERT_TRUE(resumed.has_value()) << to_string(resumed.error());
  second.sequence = first.sequence, second.time_s = first.time_s;
  for (int i = 13; i <= 18; ++i) {
    const auto go_on = [&](Game& game) {
      TickMaker tick = game.tick(kTickS);
      if (i == 14) tick.delta.add = {box(game, 30, 5), box(game, 31, 6)};
      return reply_of(game, game.play(tick.move(kAnn, {-1 + 0.01 * i, 1, 0})));
    };
    EXPECT_EQ(go_on(second), go_on(first)) << "tick " << i;
    EXPECT_EQ(second.session->mirror().hash(), first.session->mirror().hash());
    EXPECT_EQ(second.session->mirror().revision(), first.session->mirror().revision());
    for (const uint64_t id : {uint64_t{22}, uint64_t{23}, uint64_t{30}, uint64_t{31}})
      EXPECT_EQ(second.session->mirror().slot_of(id), first.session->mirror().slot_of(id)) << id;
  }
}

TEST(SessionMemory, OfAnotherSceneIsRefused) {
  Game first;
  for (int i = 1; i <= 3; ++i) play(first, i);
  std::string memory;
  first.session->write_memory(memory);
  const auto refused = [&](const std::function<void(Game&)>& change) {
    Game other;
    change(other);
    const Status resumed = other.session->resume(Session::memory_layout(), memory);
    return resumed ? std::string() : resumed.error().message;
  };
  const auto with_delta = [](const std::function<void(Game&, SceneDelta&)>& make) {
    return [make](Game& game) {
      TickMaker tick = game.tick(kTickS);
      make(game, tick.delta);
      if (!tick.delta.remove.empty()) tick.targets = {Game::target(kBob)};
      game.apply(tick);
    };
  };
  EXPECT_EQ(refused([](Game&) {}), "");
  EXPECT_EQ(refused(with_delta([](Game&, SceneDelta& delta) { delta.remove = {kCrate}; })), "is of another scene");
  EXPECT_EQ(refused(with_delta([](Game&, SceneDelta& delta) { delta.remove = {kAnn}; })),
            "is of a session with other targets");
  EXPECT_EQ(
      refused(with_delta([](Game& game, SceneDelta& delta) { delta.add = {game.make(40, SphereShape{0.1f}, {})}; })),
      "is of another scene");
}

// The bytes hold the motion of each target: a ring of 32 steps for its travel and one for its turns. Both say, one
// behind the other, which step is next and how many there are.
TEST(SessionMemory, StepsOutsideTheirRingAreRefused) {
  const auto options = [](SessionOptions& o) { o.settings = preset_settings(Preset::kSightline); };
  Game first(options), second(options);
  constexpr uint64_t kTicks = 22;
  for (uint64_t i = 1; i <= kTicks; ++i) play(first, static_cast<int>(i));
  std::string memory;
  first.session->write_memory(memory);
  const auto pair_of = [](uint64_t next, uint64_t count) {
    std::string bytes(reinterpret_cast<const char*>(&next), sizeof next);
    return bytes.append(reinterpret_cast<const char*>(&count), sizeof count);
  };
  const auto accepted = [&](size_t at, uint64_t next, uint64_t count) {
    std::string damaged = memory;
    damaged.replace(at, 16, pair_of(next, count));
    return second.session->resume(Session::memory_layout(), damaged).has_value();
  };
  // Other figures may have the same bytes; any values of these are accepted.
  size_t rings = 0;
  for (const uint64_t count : {kTicks - 1, kTicks})
    for (size_t at = 0; (at = memory.find(pair_of(count, count), at)) != std::string::npos; ++at)
      rings += accepted(at, 31, 32) && !accepted(at, 32, 32) && !accepted(at, 31, 33);
  EXPECT_EQ(rings, 4u) << "two for each target";
}

// Bytes of the memory changed one number at a time to one that no motion has: it is refused, or the next steps are
// sound. (A step that is not is an error of the kind kInternal.)
TEST(SessionMemory, NumbersOfTracksThatNoMotionHasDoNoHarm) {
  const auto options = [](SessionOptions& o) { o.settings = preset_settings(Preset::kSightline); };
  Game first(options);
  for (int i = 1; i <= 40; ++i)
    first.play(first.tick(kTickS).move(kAnn, {-1 + 0.05 * (i / 2), 1, 0}).move(kBob, {1 + 0.01 * (i % 3), 1, 0}));
  ASSERT_GT(glm::length(first.instance(kAnn).velocity_mps), 0.5) << "its positions are known to be held";
  std::string memory;
  first.session->write_memory(memory);
  int refused = 0, played = 0;
  for (size_t at = 0; at + sizeof(double) <= memory.size(); at += 8) {
    for (const double value : {-1.0, 1e200}) {
      if (at > 3000) break;  // the scene, the targets and the tracks come first
      std::string damaged = memory;
      std::memcpy(damaged.data() + at, &value, sizeof value);
      Game second(options);
      if (!second.session->resume(Session::memory_layout(), damaged)) {
        ++refused;
        continue;
      }
      second.sequence = first.sequence, second.time_s = first.time_s;
      const Status applied = second.session->apply(
          second.tick(kTickS).move(kAnn, {0.1, 1, 0}).move(kBob, {1.01, 1, 0}));
      if (applied) (void)second.session->step();
      for (const Instance& instance : second.session->mirror().instances()) {
        const bool sound = !instance.geometry || is_finite(instance.center_m);
        EXPECT_TRUE(sound) << at << " " << value;
      }
      ++played;
    }
  }
  EXPECT_GT(refused, 100);
  EXPECT_GT(played, 5);
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
