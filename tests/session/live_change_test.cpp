// Settings, limits and lenses that change while the session runs. They hold from the same step on, nothing of the
// former ones remains, and the camera moves on within its limits.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "server/base/random.h"
#include "tests/session/game.h"

namespace sightline::test {
namespace {

constexpr double kTick = 1.0 / 60;

// Ann and Bob walk back and forth behind two columns, and cross.
struct Walk {
  ExtentCache extents;
  Game game;

  explicit Walk(const StepSettings& settings = preset_settings(Preset::kSightline))
      : game([&](SessionOptions& options) {
          options.settings = settings;
          options.extents = &extents;
        }) {}

  TickMaker next() {
    TickMaker tick = game.tick(kTick);
    const double t = game.time_s;
    tick.move(kAnn, {3 * std::sin(0.9 * t), 1, 1.5 * std::cos(0.7 * t) - 1.5});
    tick.move(kBob, {2 - 3 * std::sin(0.6 * t), 1, 0.5 * std::sin(t)});
    return tick;
  }
  SessionAnswer play(const std::optional<StepSettings>& change = {}) {
    TickMaker tick = next();
    tick.settings = change;
    return game.play(tick);
  }
  SessionAnswer play_for(double seconds) {
    SessionAnswer last;
    for (int i = 0; i < std::lround(seconds / kTick); ++i) last = play();
    return last;
  }
};

ViewAngles angles_of(const SessionAnswer& answer) {
  return angles_from_rotation(answer.step.camera.pose.rotation);
}

double wrapped(double rad) {
  return std::remainder(rad, 2 * std::numbers::pi);
}

// Checks the path by finite differences of the answers alone. `limits` may change: a camera that is beyond a new limit
// brakes as hard as it may.
class PathCheck {
 public:
  void follow(const SessionAnswer& answer, const CameraLimits& limits) {
    const glm::dvec3 place = answer.step.camera.pose.position_m;
    const ViewAngles angles = angles_of(answer);
    if (++seen_ > 1) {
      const glm::dvec3 velocity = (place - place_m_) / kTick;
      const glm::dvec2 turn(wrapped(angles.yaw_rad - angles_.yaw_rad) / kTick,
                            (angles.pitch_rad - angles_.pitch_rad) / kTick);
      if (seen_ > 2) {
        check(velocity, velocity_, limits.max_speed_mps, limits.max_acceleration_mps2);
        check(glm::dvec3(turn, 0), glm::dvec3(turn_, 0), limits.max_angular_speed_radps,
              limits.max_angular_acceleration_radps2);
      }
      velocity_ = velocity, turn_ = turn;
    }
    place_m_ = place, angles_ = angles;
  }
  const glm::dvec3& velocity_mps() const { return velocity_; }
  const glm::dvec2& turn_radps() const { return turn_; }

 private:
  void check(const glm::dvec3& now, const glm::dvec3& before, double most, double most_change) const {
    constexpr double kRounding = 1e-6;
    EXPECT_LE(glm::length(now - before), most_change * kTick + kRounding) << "step " << seen_;
    const double braked = glm::length(before) - most_change * kTick;
    EXPECT_LE(glm::length(now), std::max(most, braked) + kRounding) << "step " << seen_;
  }

  int seen_ = 0;
  glm::dvec3 place_m_{0.0}, velocity_{0.0};
  ViewAngles angles_;
  glm::dvec2 turn_{0.0};
};

void expect_same(const SessionAnswer& a, const SessionAnswer& b, const std::string& where) {
  SCOPED_TRACE(where);
  EXPECT_EQ(a.step.camera.pose.position_m, b.step.camera.pose.position_m);
  EXPECT_EQ(a.step.camera.pose.rotation, b.step.camera.pose.rotation);
  EXPECT_EQ(a.step.camera.velocity_mps, b.step.camera.velocity_mps);
  EXPECT_EQ(a.step.reason, b.step.reason);
  EXPECT_EQ(a.step.volume, b.step.volume);
  EXPECT_EQ(a.step.chosen_candidate, b.step.chosen_candidate);
  ASSERT_EQ(a.step.targets.size(), b.step.targets.size());
  for (size_t i = 0; i < a.step.targets.size(); ++i) {
    EXPECT_EQ(a.step.targets[i].visible_share, b.step.targets[i].visible_share) << i;
    EXPECT_EQ(a.step.targets[i].filtered_share, b.step.targets[i].filtered_share) << i;
    EXPECT_EQ(a.step.targets[i].filtered_visible, b.step.targets[i].filtered_visible) << i;
  }
}

// ---- switching to and fro ----

std::vector<SessionAnswer> walk_with_a_switch_every_half_second() {
  Walk walk;
  std::vector<SessionAnswer> answers;
  for (int i = 0; i < 12 * 60; ++i) {
    const Preset preset = i / 30 % 2 == 0 ? Preset::kSightline : Preset::kPaper;
    answers.push_back(i % 30 == 0 ? walk.play(preset_settings(preset)) : walk.play());
    EXPECT_EQ(answers.back().step.pair_asked, preset_settings(preset).aggregate.volume == Volume::kPair) << i;
  }
  return answers;
}

TEST(LiveChange, SwitchingPresetsEveryHalfSecondKeepsTheLimits) {
  PathCheck path;
  double walked_m = 0, turned_rad = 0;
  for (const SessionAnswer& answer : walk_with_a_switch_every_half_second()) {
    path.follow(answer, CameraLimits{});
    walked_m += glm::length(path.velocity_mps()) * kTick;
    turned_rad += glm::length(path.turn_radps()) * kTick;
    EXPECT_FALSE(answer.cut);
  }
  EXPECT_GT(walked_m, 3.0) << "a camera that stands still proves nothing";
  EXPECT_GT(turned_rad, 0.5);
}

TEST(LiveChange, SwitchingPresetsRepeatsBitForBit) {
  const auto first = walk_with_a_switch_every_half_second(), second = walk_with_a_switch_every_half_second();
  for (size_t i = 0; i < first.size(); ++i) expect_same(first[i], second[i], std::to_string(i));
}

// ---- nothing of the former settings remains ----

StepSettings random_settings(CounterRandom& random) {
  StepSettings s = preset_settings(random.next_unit() < 0.5 ? Preset::kSightline : Preset::kPaper);
  const auto one_of = [&](int n) { return static_cast<int>(random.next_unit() * n); };
  s.bound.mode = static_cast<BoundMode>(one_of(2));
  s.bound.horizon_s = random.next_in(0.2, 0.9);
  s.sample.resolution = 4 + one_of(9);
  s.sample.points = one_of(5);
  s.bound.target_reach_m = one_of(2) * 5.0;
  s.move.search_viewpoints = one_of(2) == 1;
  s.sample.jitter = one_of(2) == 1;
  s.aggregate.volume = static_cast<Volume>(one_of(2));
  s.aggregate.candidates = 100 + one_of(500);
  s.aggregate.filter.mode = static_cast<FilterMode>(one_of(3));
  s.aggregate.filter.n = 1 + one_of(30);
  s.move.strategy = static_cast<Strategy>(one_of(3));
  s.move.prediction_s = one_of(2) * 0.3;
  return s;
}

// A cut to a place that no settings have led to, so the history of the candidates there is empty.
ObservedCamera far_cut() {
  return {{{40, 2, 30}, {1, 0, 0, 0}}, {}, true};
}

// One session has run under other settings before, the other has not. Then both have no targets for one step, which
// clears all that is known of the targets. A cut takes both cameras to the same place. From then on they must give the
// same answers.
void expect_no_trace_of(const std::vector<StepSettings>& former, const StepSettings& last, const std::string& where) {
  Walk changed(former.front()), always(last);
  for (size_t i = 1; i < former.size(); ++i) {
    for (int k = 0; k < 15; ++k) changed.play(), always.play();
    changed.play(former[i]), always.play();
  }
  for (int k = 0; k < 20; ++k) changed.play(), always.play();
  changed.play(last), always.play();
  for (int k = 0; k < 3; ++k) changed.play(), always.play();
  const std::vector<Target> targets = changed.game.session->targets();
  for (int k = 0; k < 45; ++k) {
    TickMaker tick = changed.next(), same = always.next();
    if (k == 0) tick.targets = same.targets.emplace();
    if (k == 1) tick.targets = same.targets = targets;
    if (k <= 1) tick.observed_camera = same.observed_camera = far_cut();
    expect_same(changed.game.play(tick), always.game.play(same), where + " step " + std::to_string(k));
    if (testing::Test::HasFailure()) return;
  }
}

TEST(LiveChange, LeavesNothingOfTheFormerSettings) {
  for (uint64_t seed = 0; seed < 24; ++seed) {
    CounterRandom random(seed, 0, RandomPurpose::kTest);
    std::vector<StepSettings> former;
    for (int i = 0; i < 3; ++i) former.push_back(random_settings(random));
    expect_no_trace_of(former, random_settings(random), "seed " + std::to_string(seed));
    if (HasFailure()) return;
  }
}

TEST(LiveChange, TheSameSettingsAgainChangeNothing) {
  Walk told, spared;
  for (int i = 0; i < 120; ++i) {
    const auto same = i % 7 == 0 ? std::optional(told.game.session->settings()) : std::nullopt;
    expect_same(told.play(same), spared.play(), std::to_string(i));
  }
}

// ---- each part that a setting reaches ----

TEST(LiveChange, ResolutionAndDensityHoldFromTheVeryStepOn) {
  Walk walk;
  StepSettings settings = walk.game.session->settings();
  settings.move.decide_every_s = 0;
  for (const int resolution : {7, 31, 3, 64, 5}) {
    settings.sample.resolution = resolution, settings.aggregate.candidates = 27 * resolution;
    walk.play(settings);
    const StepDump& dump = walk.game.session->dump();
    EXPECT_EQ(dump.maps[0].view.width, resolution);
    EXPECT_EQ(dump.maps[0].distance_m.size(), static_cast<size_t>(resolution * resolution));
    const double cells = static_cast<double>(dump.sights.candidates.size());
    EXPECT_GT(cells, 0.8 * settings.aggregate.candidates);
    EXPECT_LT(cells, 2.0 * settings.aggregate.candidates + 10);
  }
}

TEST(LiveChange, SurfacePointsComeAndGo) {
  Walk walk;
  StepSettings settings = walk.game.session->settings();
  settings.move.decide_every_s = 0;
  for (const int points : {0, 8, 0, 3}) {
    settings.sample.points = points;
    walk.play(settings);
    const SamplePlan& plan = walk.game.session->dump().plan;
    EXPECT_EQ(plan.now.sights_of_target[0].count, std::max(points, 1)) << points;
    EXPECT_EQ(plan.now.points_of_target[0].count, std::max((points + 1) / 2, 1)) << "every second point costs a map";
  }
}

TEST(LiveChange, PredictionComesAndGoes) {
  Walk walk;
  walk.play_for(1.0);
  StepSettings settings = walk.game.session->settings();
  settings.move.prediction_s = 0.1;
  walk.play(settings);
  EXPECT_DOUBLE_EQ(walk.game.session->dump().plan.ahead_s, 0.1) << "the targets' past is there at once";
  settings.move.prediction_s = 0.2;
  walk.play(settings);
  EXPECT_GT(walk.game.session->dump().plan.ahead_s, 0.1);
  settings.move.prediction_s = 0.0;
  walk.play(settings);
  EXPECT_EQ(walk.game.session->dump().plan.ahead_s, 0.0);
}

TEST(LiveChange, TheHorizonFollowsAtOnce) {
  Walk walk;
  StepSettings settings = walk.game.session->settings();
  settings.bound.horizon_s = 1.0;
  walk.play(settings);
  EXPECT_GE(walk.game.session->dump().bound.horizon_s, 1.0);
  settings.bound.horizon_s = 0.1, settings.bound.max_horizon_s = 0.2;
  walk.play(settings);
  EXPECT_LE(walk.game.session->dump().bound.horizon_s, 0.2);
}

// A filter that was switched off must not treat its old samples as the newest when it is switched on again.
TEST(LiveChange, AFilterThatComesOnAgainDoesNotTakeTheOldForTheNew) {
  for (const FilterMode mode : {FilterMode::kJoint, FilterMode::kPerTarget}) {
    Game game([](SessionOptions& options) { options.camera.position_m = {0.9, 1, 6}; });
    StepSettings on = game.session->settings(), off = on;
    on.aggregate.filter.mode = mode, off.aggregate.filter.mode = FilterMode::kNone;
    on.move.follow = off.move.follow = Follow::kStay;
    const auto play = [&](const StepSettings& settings, double wall_x, int steps) {
      SessionAnswer answer;
      for (int i = 0; i < steps; ++i) {
        TickMaker tick = game.tick(kTick).move(kWall, {wall_x, 1, 3});
        tick.settings = settings;
        // The game holds the camera, so its position is the same all along.
        tick.observed_camera = ObservedCamera{{{0.9, 1, 6}, {1, 0, 0, 0}}, {}, true};
        answer = game.play(tick);
      }
      return answer.step.targets[1];
    };
    EXPECT_FALSE(play(on, 0.9, 40).filtered_visible) << "the wall hides Bob";
    EXPECT_TRUE(play(off, 20, 40).filtered_visible);
    EXPECT_TRUE(play(on, 20, 1).filtered_visible) << "he has been in view for 40 steps";
  }
}

TEST(LiveChange, AZoomThatEndsGoesBackToTheLensWithoutAJump) {
  Walk walk;
  const double told = Lens{}.vertical_fov_rad;
  StepSettings zoom = walk.game.session->settings();
  zoom.framing.min_vertical_fov_rad = 0.3, zoom.framing.max_vertical_fov_rad = 0.35;
  walk.play(zoom);
  const double zoomed = walk.play_for(3.0).lens.vertical_fov_rad;
  ASSERT_LT(zoomed, 0.5);
  double last = zoomed;
  walk.play(preset_settings(Preset::kSightline));
  for (int i = 0; i < 120; ++i) {
    const double now = walk.play().lens.vertical_fov_rad;
    EXPECT_GE(now, last);
    EXPECT_LT(now - zoomed, (told - zoomed) * (i + 2) * 0.2) << i;
    last = now;
  }
  EXPECT_NEAR(last, told, 1e-3);
}

// ---- limits ----

struct Chase : Walk {
  PathCheck path;
  CameraLimits limits;
  // Ann and Bob run to the right together, `speed_mps` fast.
  SessionAnswer run(double speed_mps, const std::optional<CameraLimits>& change = {}) {
    TickMaker tick = game.tick(kTick);
    x_m += speed_mps * kTick;
    tick.move(kAnn, {x_m - 1, 1, 0}).move(kBob, {x_m + 1, 1, 0}).move(kWall, {0, 1, -40});
    tick.limits = change;
    if (change) limits = *change;
    const SessionAnswer answer = game.play(tick);
    path.follow(answer, limits);
    return answer;
  }
  double x_m = 0;
};

TEST(LiveChange, ALowerSpeedIsBrakedToAsHardAsTheAccelerationAllows) {
  Chase chase;
  for (int i = 0; i < 180; ++i) chase.run(8);
  const double before = glm::length(chase.path.velocity_mps());
  ASSERT_GT(before, 5.0);
  CameraLimits slower;
  slower.max_speed_mps = 2, slower.max_acceleration_mps2 = 5;
  chase.run(8, slower);
  for (double expected = before - 5 * kTick; expected > 2.2; expected -= 5 * kTick) {
    EXPECT_NEAR(glm::length(chase.path.velocity_mps()), expected, 0.05);
    chase.run(8);
  }
  for (int i = 0; i < 30; ++i) chase.run(8);
  EXPECT_LE(glm::length(chase.path.velocity_mps()), 2 + 1e-6);
  chase.run(8, CameraLimits{});
  for (int i = 0; i < 120; ++i) chase.run(8);
  EXPECT_GT(glm::length(chase.path.velocity_mps()), 2.5) << "and a higher one is used again";
}

TEST(LiveChange, LowerAngularLimitsAreBrakedTo) {
  Chase chase;
  CameraLimits still, slower;
  still.max_speed_mps = 1e-3;
  chase.run(0, still);
  for (int i = 0; i < 60; ++i) chase.run(9);
  ASSERT_GT(glm::length(chase.path.turn_radps()), 0.4);
  slower = still;
  slower.max_angular_speed_radps = 0.1, slower.max_angular_acceleration_radps2 = 2;
  chase.run(9, slower);
  for (int i = 0; i < 60; ++i) chase.run(9);
  EXPECT_LE(glm::length(chase.path.turn_radps()), 0.1 + 1e-6);
}

TEST(LiveChange, LimitsThatChangeAtRandomAreKeptAtEveryStep) {
  Chase chase;
  CounterRandom random(3, 0, RandomPurpose::kTest);
  for (int i = 0; i < 900; ++i) {
    std::optional<CameraLimits> change;
    if (i % 20 == 0)
      change = {random.next_in(0.5, 15), random.next_in(2, 30), random.next_in(0.1, 4), random.next_in(1, 20), 0.3};
    chase.run(8 * std::sin(0.02 * i), change);
  }
}

// ---- merged ticks ----

TEST(LiveChange, OfMergedTicksTheNewestOfEachHolds) {
  Game merged;
  StepSettings first = merged.session->settings(), second = first;
  first.sample.resolution = 30, second.sample.resolution = 12;
  CameraLimits limits;
  limits.max_speed_mps = 3;
  TickMaker a = merged.tick(), b = merged.tick(), c = merged.tick();
  a.settings = first, b.settings = second, b.limits = limits, c.lens = Lens{.vertical_fov_rad = 0.9};
  for (const TickInput& tick : {a, b, c}) merged.apply(tick);
  EXPECT_EQ(merged.answer().lens.vertical_fov_rad, 0.9);
  EXPECT_EQ(merged.session->dump().maps[0].view.width, 12);
  EXPECT_EQ(merged.session->limits().max_speed_mps, 3);
}

}  // namespace
}  // namespace sightline::test
