// The observed camera of a client that follows the replies exactly, late or smoothed, and of one that moves the camera
// itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>

#include "server/base/random.h"
#include "tests/session/game.h"

namespace sightline::test {
namespace {

constexpr double kTickS = 1.0 / 60;
using Replies = std::vector<SessionAnswer>;
using Observe = std::function<std::optional<ObservedCamera>(const Replies&)>;

std::optional<ObservedCamera> nothing(const Replies&) {
  return std::nullopt;
}

// Two people walk at 3 m/s, in bends, and are filmed with the default preset.
class Walk {
 public:
  explicit Walk(const Convention& convention = {}, bool searches_viewpoints = true)
      : game_([&](SessionOptions& options) {
          options.settings = preset_settings(Preset::kSightline);
          options.settings.move.search_viewpoints = searches_viewpoints;
          options.convention = convention;
        }) {}

  // The answers of `ticks` ticks; `observe` is asked before each of them.
  Replies play(int ticks, const Observe& observe) {
    Replies replies;
    for (int i = 1; i <= ticks; ++i) {
      TickMaker tick = game_.tick(kTickS);
      const glm::dvec3 middle = middle_m(i * kTickS);
      tick.move(kAnn, middle + glm::dvec3(-1, 0, 0)).move(kBob, middle + glm::dvec3(1, 0, 0));
      tick.observed_camera = observe(replies);
      replies.push_back(game_.play(tick));
    }
    return replies;
  }
  static glm::dvec3 middle_m(double time_s) { return {3 * time_s, 1, 2 * (1 - std::cos(0.7 * time_s))}; }
  const CameraLimits& limits() const { return game_.session->limits(); }

 private:
  Game game_;
};

void expect_same(const Replies& a, const Replies& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    const CameraState &one = a[i].step.camera, &other = b[i].step.camera;
    ASSERT_EQ(one.pose.position_m, other.pose.position_m) << "tick " << i;
    ASSERT_EQ(one.pose.rotation, other.pose.rotation) << "tick " << i;
    ASSERT_EQ(one.velocity_mps, other.velocity_mps) << "tick " << i;
    ASSERT_EQ(one.angular_velocity_radps, other.angular_velocity_radps) << "tick " << i;
    for (size_t k = 0; k < a[i].step.targets.size(); ++k)
      ASSERT_EQ(a[i].step.targets[k].filtered_share, b[i].step.targets[k].filtered_share) << "tick " << i;
  }
}

// The rates of yaw and pitch between two poses. The limit of the angular acceleration is one of their change.
glm::dvec2 rates_radps(const SessionAnswer& before, const SessionAnswer& now) {
  const ViewAngles from = angles_from_rotation(before.step.camera.pose.rotation),
                   to = angles_from_rotation(now.step.camera.pose.rotation);
  return glm::dvec2(std::remainder(to.yaw_rad - from.yaw_rad, 2 * std::numbers::pi), to.pitch_rad - from.pitch_rad) /
         kTickS;
}

// Every reply keeps the limits relative to the reply before.
void expect_within(const CameraLimits& limits, const Replies& replies) {
  for (size_t i = 1; i < replies.size(); ++i) {
    const CameraState &before = replies[i - 1].step.camera, &now = replies[i].step.camera;
    const glm::dvec3 velocity_mps = (now.pose.position_m - before.pose.position_m) / kTickS;
    ASSERT_LE(glm::length(velocity_mps), limits.max_speed_mps * (1 + 1e-9)) << "tick " << i;
    ASSERT_LE(glm::length(velocity_mps - before.velocity_mps),
              limits.max_acceleration_mps2 * kTickS * (1 + 1e-6) + 1e-9)
        << "tick " << i;
    ASSERT_LE(angle_between(now.pose.rotation, before.pose.rotation),
              limits.max_angular_speed_radps * kTickS * (1 + 1e-6))
        << "tick " << i;
    if (i < 2) continue;
    ASSERT_LE(glm::length(rates_radps(replies[i - 1], replies[i]) - rates_radps(replies[i - 2], replies[i - 1])),
              limits.max_angular_acceleration_radps2 * kTickS * (1 + 1e-6) + 1e-9)
        << "tick " << i;
  }
}

glm::dvec3 rounded(const glm::dvec3& v) {
  return glm::dvec3(glm::vec3(v));
}

// A pose as a client gives it back that keeps it in its own frame, in single precision.
Pose sent_back(const Convention& c, const Pose& pose) {
  const Pose theirs = camera_to_client(c, pose);
  const glm::dquat& q = theirs.rotation;
  const glm::dquat kept = glm::normalize(
      glm::dquat(static_cast<float>(q.w), static_cast<float>(q.x), static_cast<float>(q.y), static_cast<float>(q.z)));
  return camera_from_client(c, {rounded(theirs.position_m), kept});
}

Convention far_away(Convention c) {
  c.origin_m = {100'000, 20, -70'000};
  return c;
}

TEST(ObservedCamera, AClientThatSendsEachReplyBackGetsTheSameReplies) {
  for (const Convention& c : {gltf_convention(), unity_convention(), unreal_convention(), ros_convention(),
                              far_away(unreal_convention()), far_away(unity_convention())}) {
    const auto echo = [&](const Replies& replies) -> std::optional<ObservedCamera> {
      if (replies.empty()) return std::nullopt;
      return ObservedCamera{sent_back(c, replies.back().step.camera.pose), {}, false, {}};
    };
    expect_same(Walk(c).play(300, nothing), Walk(c).play(300, echo));
    if (testing::Test::HasFatalFailure()) return;
  }
}

TEST(ObservedCamera, AClientThatIsLateByAQuarterOfASecondGetsTheSameReplies) {
  for (const size_t late : {2, 7, 15}) {
    const auto echo = [&](const Replies& replies) -> std::optional<ObservedCamera> {
      if (replies.size() <= late) return std::nullopt;
      const CameraState& camera = replies[replies.size() - 1 - late].step.camera;
      return ObservedCamera{camera.pose, camera.velocity_mps, false, camera.angular_velocity_radps};
    };
    expect_same(Walk().play(400, nothing), Walk().play(400, echo));
    if (testing::Test::HasFatalFailure()) return;
  }
}

// A camera that follows the newest reply with a time constant.
class Smoothed {
 public:
  explicit Smoothed(double time_constant_s) : share_(-std::expm1(-kTickS / time_constant_s)) {}
  std::optional<ObservedCamera> operator()(const Replies& replies) {
    if (replies.empty()) return std::nullopt;
    const Pose& aim = replies.back().step.camera.pose;
    if (replies.size() == 1) pose_ = aim;
    pose_.position_m += share_ * (aim.position_m - pose_.position_m);
    pose_.rotation = glm::slerp(pose_.rotation, aim.rotation, share_);
    return ObservedCamera{pose_, {}, false, {}};
  }

 private:
  const double share_;
  Pose pose_;
};

// The shot stays the same, because another one, as good, may be 1.6 m farther away. The people set out to one side of
// the camera, which comes back to its place beside them by any of several ways. Only then are the distances compared.
TEST(ObservedCamera, ASuggestionLeadsAClientThatSmooths) {
  constexpr size_t kTicks = 1700, kSettledAt = 700;  // the people walk 85 m, 35 m of it until then
  const auto mean_distance_m = [](const Replies& replies) {
    double sum = 0;
    for (size_t i = kSettledAt; i < kTicks; ++i)
      sum += glm::distance(place_of(replies[i]), Walk::middle_m(static_cast<double>(i + 1) * kTickS));
    return sum / static_cast<double>(kTicks - kSettledAt);
  };
  Walk free({}, false);
  const double free_m = mean_distance_m(free.play(kTicks, nothing));
  for (const double time_constant_s : {0.1, 0.2, 0.3}) {
    Walk walk({}, false);
    const Replies replies = walk.play(kTicks, Smoothed(time_constant_s));
    expect_within(walk.limits(), replies);
    EXPECT_NEAR(mean_distance_m(replies), free_m, 0.05) << time_constant_s;
    EXPECT_GT(place_of(replies.back()).x, 75.0) << time_constant_s;
  }
}

// Random displacements of less than 1 m, each kept for a while, beside random delays.
TEST(ObservedCamera, NearThePathTheLimitsHoldFromReplyToReply) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    CounterRandom random(seed, 0, RandomPurpose::kTest);
    glm::dvec3 aside_m(0.0);
    size_t late = 0;
    const auto roam = [&](const Replies& replies) -> std::optional<ObservedCamera> {
      if (random.next_below(20) == 0)
        aside_m = 0.55 * glm::dvec3(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1)),
        late = random.next_below(20);
      if (replies.size() <= late) return std::nullopt;
      Pose pose = replies[replies.size() - 1 - late].step.camera.pose;
      pose.position_m += aside_m;
      return ObservedCamera{pose, {}, false, {}};
    };
    Walk walk;
    expect_within(walk.limits(), walk.play(600, roam));
  }
}

// A camera at rest, without a target that it would move for.
Game resting(const glm::dvec3& at) {
  return Game([&](SessionOptions& options) {
    options.camera.position_m = at;
    options.limits.max_jerk_mps3 = 0;  // the pull alone, without the acceleration that it leaves behind
    for (Target& target : options.targets) target.weight = 0;
  });
}

TEST(ObservedCamera, TheSuggestionIsPulledSlowlyToACameraNearby) {
  Game game = resting({0, 1.6, 6});
  const glm::dvec3 there(0.5, 1.9, 6.2);
  double last_m = glm::distance(place_of(game.play(game.tick(kTickS))), there);
  const double first_m = last_m;
  Replies replies;
  for (int i = 0; i < 300; ++i) {
    TickMaker tick = game.tick(kTickS);
    tick.observed_camera = seen_at(there, false);
    replies.push_back(game.play(tick));
    const double now_m = glm::distance(place_of(replies.back()), there);
    ASSERT_LE(now_m, last_m + 1e-12) << i;
    ASSERT_LE(last_m - now_m, first_m * kTickS * (1 + 1e-9)) << "not faster than 1/s of the distance";
    last_m = now_m;
  }
  expect_within(game.session->limits(), replies);
  EXPECT_LT(last_m, 0.02);
  TickMaker last = game.tick(kTickS);
  EXPECT_LT(glm::distance(place_of(game.play(last)), place_of(replies.back())), 0.01)
      << "the pull ends with the observation";
}

TEST(ObservedCamera, ThePullDoesNotLeadThroughAWall) {
  Game game = resting({0.9, 1, 3.6});  // the wall's near side is at z = 3.1
  for (int i = 0; i < 300; ++i) {
    TickMaker tick = game.tick(kTickS);
    tick.observed_camera = seen_at({0.9, 1, 2.7}, false);
    ASSERT_GE(place_of(game.play(tick)).z, 3.1 + game.session->limits().body_radius_m) << i;
  }
}

TEST(ObservedCamera, FarFromThePathTheSuggestionStartsAgainWithWhatIsSent) {
  Game game;
  for (int i = 0; i < 10; ++i) game.play(game.tick(kTickS));
  const CameraLimits& limits = game.session->limits();
  const glm::dvec3 at(20, 3, 6), velocity_mps(4, 0, 0);
  TickMaker tick = game.tick(kTickS);
  tick.observed_camera = ObservedCamera{
      {at, glm::angleAxis(1.0, glm::dvec3(0, 1, 0))}, velocity_mps, false, {0, 1.5, 0}};
  const SessionAnswer answer = game.play(tick);
  const CameraState& camera = answer.step.camera;
  EXPECT_LE(glm::length(camera.velocity_mps - velocity_mps), limits.max_acceleration_mps2 * kTickS * (1 + 1e-9));
  EXPECT_LE(glm::distance(camera.pose.position_m, at + velocity_mps * kTickS),
            limits.max_acceleration_mps2 * kTickS * kTickS * 1.01);
  const TurnState& turn = game.session->carried().turn;
  EXPECT_LE(std::hypot(turn.yaw_rate_radps - 1.5, turn.pitch_rate_radps),
            limits.max_angular_acceleration_radps2 * kTickS * (1 + 1e-9));
  EXPECT_LE(std::abs(turn.angles.yaw_rad - (1.0 + turn.yaw_rate_radps * kTickS)), 1e-9);
  EXPECT_FALSE(answer.cut);
}

// A client that keeps the camera's position to itself, but turns it as suggested.
TEST(ObservedCamera, TurningGoesOnWhenOnlyThePositionIsTheClients) {
  Game game;
  glm::dvec3 before(0.0);
  double turned = 0;
  Pose pose;
  pose.position_m = {0, 1.6, 6};
  for (int i = 0; i < 60; ++i) {
    TickMaker tick = game.tick(kTickS);
    const glm::dvec3 step(0.1 * i, 0, 0);
    tick.move(kAnn, glm::dvec3(-1, 1, 0) + step).move(kBob, glm::dvec3(1, 1, 0) + step);
    // Every position is far from the one before.
    pose.position_m = {0, i % 2 == 0 ? 1.6 : 4.0, 6};
    if (i > 0) tick.observed_camera = ObservedCamera{pose, {}, false, {}};
    const SessionAnswer answer = game.play(tick);
    pose.rotation = answer.step.camera.pose.rotation;
    const glm::dvec3 now = answer.step.camera.angular_velocity_radps;
    EXPECT_LE(glm::length(now - before), game.session->limits().max_angular_acceleration_radps2 * kTickS * 1.01 + 1e-3)
        << i;
    before = now;
    turned = std::max(turned, glm::length(now));
  }
  EXPECT_GT(turned, 2 * game.session->limits().max_angular_acceleration_radps2 * kTickS)
      << "more than one tick can reach";
}

TEST(ObservedCamera, AReplyThatIsSentBackInAMergedTickLosesNoTime) {
  Game with, without;
  for (int i = 0; i < 20; ++i) {
    const CameraState& camera = with.session->carried().camera;
    with.apply(with.tick(kTickS).move(kAnn, {-1 + 0.1 * i, 1, 0})),
        without.apply(without.tick(kTickS).move(kAnn, {-1 + 0.1 * i, 1, 0}));
    TickMaker second = with.tick(kTickS);
    second.observed_camera = ObservedCamera{camera.pose, {}, false, {}};
    EXPECT_EQ(place_of(with.play(second)), place_of(without.play(without.tick(kTickS)))) << i;
  }
}

TEST(ObservedCamera, AVelocityThatIsSentBeforeTheFirstReplyCounts) {
  Game game = resting({0, 1.6, 6});
  TickMaker tick = game.tick(kTickS);
  tick.observed_camera = ObservedCamera{{{0, 1.6, 6}, {1, 0, 0, 0}}, {5, 0, 0}, false, {}};
  EXPECT_GT(game.play(tick).step.camera.velocity_mps.x, 4.5);
}

}  // namespace
}  // namespace sightline::test
