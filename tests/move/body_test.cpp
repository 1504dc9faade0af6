#include "server/move/body.h"

#include <gtest/gtest.h>

#include "server/base/random.h"
#include "server/move/motion.h"
#include "server/sample/embree_scene.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

class Body : public testing::Test {
 protected:
  void add_box(const glm::dvec3& at, const glm::vec3& half, const glm::dquat& rotation = {1, 0, 0, 0}) {
    SceneDelta delta;
    delta.add.push_back(
        {next_id_++, *store_.intern(*tessellate(BoxShape{half})), Pose{at, rotation}, glm::dmat3(1), {}});
    ASSERT_TRUE(mirror_.apply(delta, {}));
  }
  void gather() { field_.gather(mirror_, camera_.pose.position_m, 20.0, {}); }
  void advance(const glm::dvec3& wanted, double dt) {
    const glm::dvec3 limited = clamp_velocity(camera_.velocity_mps, wanted, limits_, dt);
    const SafeMove move = make_safe(camera_, limited, limits_, {}, field_, dt);
    EXPECT_LE(glm::length(move.velocity_mps), limits_.max_speed_mps * (1 + 1e-9));
    EXPECT_LE(glm::length(move.velocity_mps - camera_.velocity_mps), limits_.max_acceleration_mps2 * dt * (1 + 1e-9));
    camera_ = moved(camera_, move.velocity_mps, dt);
  }

  GeometryStore store_;
  SceneMirror mirror_;
  ClearanceField field_;
  CameraState camera_;
  CameraLimits limits_;
  uint64_t next_id_ = 1;
};

TEST_F(Body, FreeSpaceChangesNothing) {
  gather();
  const SafeMove move = make_safe(camera_, {1, 2, 3}, limits_, {}, field_, 0.016);
  EXPECT_EQ(move.velocity_mps, glm::dvec3(1, 2, 3));
  EXPECT_FALSE(move.overlap);
}

TEST_F(Body, StopsBeforeAWall) {
  add_box({0, 0, -5}, {10, 10, 0.1f});
  gather();
  for (int i = 0; i < 300; ++i) advance({0, 0, -10}, 1.0 / 60);
  EXPECT_GT(camera_.pose.position_m.z, -4.9 + limits_.body_radius_m);
  EXPECT_LT(camera_.pose.position_m.z, -4.0) << "and comes near it";
}

TEST_F(Body, SlidesAlongAWall) {
  add_box({0, 0, -2}, {100, 100, 0.1f});
  gather();
  for (int i = 0; i < 120; ++i) {
    gather();
    advance({4, 0, -4}, 1.0 / 60);
  }
  EXPECT_GT(camera_.pose.position_m.x, 4.0);
  EXPECT_GT(camera_.pose.position_m.z, -1.9 + limits_.body_radius_m);
}

// Random steering and random steps in a crowded room: by Embree's own distance query, the body never touches anything.
TEST_F(Body, NeverTouchesGeometryWhateverIsWanted) {
  CounterRandom random(71, 0, RandomPurpose::kTest);
  for (int i = 0; i < 40; ++i) {
    const glm::dvec3 at(random.next_in(-6, 6), random.next_in(-6, 6), random.next_in(-6, 6));
    if (glm::length(at) < 2.0) continue;
    const glm::dquat turn = glm::normalize(
        glm::dquat(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1)));
    add_box(at, {random.next_in(0.1, 1), random.next_in(0.1, 1), random.next_in(0.1, 1)}, turn);
  }
  EmbreeDevice device;
  EmbreeScene reference(device, EmbreeScene::Content::kColliders);
  reference.take_in(mirror_);
  glm::dvec3 wanted(0);
  double nearest = 1e9;
  for (int step = 0; step < 6000; ++step) {
    if (random.next_below(25) == 0)
      wanted = {random.next_in(-10, 10), random.next_in(-10, 10), random.next_in(-10, 10)};
    if (glm::length(camera_.pose.position_m) > 7) wanted = -camera_.pose.position_m;
    gather();
    advance(wanted, random.next_below(100) == 0 ? 0.25 : random.next_in(0.004, 0.03));
    const float clearance = reference.nearest_surface_m(glm::vec3(camera_.pose.position_m), 5.0f);
    nearest = std::min<double>(nearest, clearance);
    ASSERT_GE(clearance, limits_.body_radius_m - 1e-4) << "step " << step;
  }
  EXPECT_LT(nearest, limits_.body_radius_m + 0.1) << "the walk came near enough to prove something";
}

// Two trunks leave less room than the body needs. However the camera is steered, and for however long, it never touches
// them and can always leave again.
TEST_F(Body, IsWedgedNowhere) {
  for (int gap_mm = -60; gap_mm <= 20; gap_mm += 4) {
    SceneDelta away;
    for (uint64_t id = 1; id < next_id_; ++id)
      if (mirror_.find(id)) away.remove.push_back(id);
    ASSERT_TRUE(mirror_.apply(away, {}));
    const double apart = 2 * limits_.body_radius_m + gap_mm * 1e-3;
    const float half = 0.2f;
    // Each box turns an edge towards the other: the gap is narrow along one line only, as between round trunks.
    const glm::dquat turned = glm::angleAxis(std::acos(-1.0) / 4, glm::dvec3(0, 1, 0));
    for (const double side : {-1.0, 1.0})
      add_box({side * (apart / 2 + half * std::sqrt(2.0)), 0, 0}, {half, 9, half}, turned);
    CounterRandom random(72, 0, RandomPurpose::kTest);
    camera_ = {};
    camera_.pose.position_m = {0, 0, 1.5};
    const glm::dvec3 edge(apart / 2, 0, 0);
    double nearest = 1e9;
    for (int i = 0; i < 900; ++i) {
      gather();
      advance({random.next_in(-2, 2), random.next_in(-0.1, 0.1), random.next_in(-4, gap_mm < 0 ? 0 : 4)}, 1.0 / 60);
      const glm::dvec3 level(camera_.pose.position_m.x, 0, camera_.pose.position_m.z);
      nearest = std::min({nearest, glm::distance(level, edge), glm::distance(level, -edge)});
    }
    EXPECT_GE(nearest, limits_.body_radius_m) << gap_mm;
    const double before_m = camera_.pose.position_m.z;
    for (int i = 0; i < 120; ++i) gather(), advance({0, 0, before_m >= 0 ? 3 : -3}, 1.0 / 60);
    EXPECT_GT(std::abs(camera_.pose.position_m.z - before_m), 2.0) << gap_mm;
  }
}

TEST_F(Body, ACameraThatAWallWasPutIntoBacksOut) {
  add_box({0, 0, -0.2}, {5, 5, 0.05f});
  gather();
  const SafeMove first = make_safe(camera_, {0, 0, -1}, limits_, {}, field_, 1.0 / 60);
  EXPECT_TRUE(first.overlap);
  for (int i = 0; i < 120; ++i) advance({0, 0, 0}, 1.0 / 60);
  EXPECT_GT(camera_.pose.position_m.z, -0.15 + limits_.body_radius_m);
  EXPECT_FALSE(make_safe(camera_, {0, 0, 0}, limits_, {}, field_, 1.0 / 60).overlap);
}

// 1 mm from touching, where the skin is 10 mm: it goes away as fast as it can still stop at the skin's edge, whatever
// is wanted.
TEST_F(Body, ABodyThatIsCloserThanItsSkinMovesAwayFirst) {
  add_box({0, 0, -5}, {10, 10, 5.0 - limits_.body_radius_m - 0.001});
  gather();
  const double missing_m = 0.009, dt = 1.0 / 60, a = limits_.max_acceleration_mps2;
  const SafeMove move = make_safe(camera_, {0, 0, -0.1}, limits_, {}, field_, dt);
  EXPECT_FALSE(move.overlap);
  EXPECT_NEAR(move.velocity_mps.z, std::min(std::sqrt(2 * a * missing_m), a * dt), 1e-3);
  for (int i = 0; i < 60; ++i) gather(), advance({0, 0, -0.1}, dt);
  EXPECT_GE(camera_.pose.position_m.z, 0.001) << "and does not come back";
}

// A box passes the camera at 10 m/s and would be 0.1 m beside its middle 0.24 s from now. The distance to a box is
// computed plainly.
TEST_F(Body, EvadesWhatComesTowardsIt) {
  const glm::dvec3 half(0.2), start(0.3, 0, -2.4), speed(0, 0, 10);
  add_box(start, half);
  ASSERT_TRUE(mirror_.apply({}, {{1}, {Pose{start, {1, 0, 0, 0}}}, {speed}, {}, {}}));
  limits_.max_acceleration_mps2 = limits_.max_speed_mps = 1000;
  MoversAhead movers;
  for (size_t look = 0; look < movers.size(); ++look)
    movers[look].gather_movers(mirror_, {0, 0, 0}, 5, {}, kEvadeS[look]);
  const auto least_distance_m = [&](const glm::dvec3& velocity) {
    double least = INFINITY;
    for (const double t : kEvadeS)
      least = std::min(least,
                       glm::length(glm::max(glm::abs(velocity * t - start - speed * t) - half, glm::dvec3(0.0))));
    return least;
  };
  ASSERT_LT(least_distance_m({0, 0, 0}), limits_.body_radius_m);
  const glm::dvec3 velocity = evade(camera_, {0, 0, 0}, limits_, {}, movers, field_, 1.0 / 60);
  EXPECT_GE(least_distance_m(velocity), limits_.body_radius_m + 0.09);
  EXPECT_LT(velocity.x, 0) << "away from it";
  EXPECT_LT(glm::length(velocity), 3) << "and no faster than is needed";
  const glm::dvec3 aside(-4, 0, 0);
  EXPECT_EQ(evade(camera_, aside, limits_, {}, movers, field_, 1.0 / 60), aside)
      << "what keeps clear already is not changed";
}

// The camera is in a doorway 1.2 m wide, or comes towards it, when its door begins to shut. Away from the door is the
// other jamb, so a camera inside has to leave through either side. One that comes fast passes, or stops in time; the
// last three touched the leaf when the camera looked 0.4 s ahead.
struct Passage {
  double speed_mps, from_m, aside_m = 0;
};
class Doorway : public Body, public testing::WithParamInterface<Passage> {};

TEST_P(Doorway, IsLeftWhenItsDoorShuts) {
  const double half_m = 0.6, leaf_mps = 1.25, dt = 1.0 / 60;
  const glm::dvec3 ahead_mps(0, 0, -GetParam().speed_mps);
  camera_.velocity_mps = ahead_mps, camera_.pose.position_m = {GetParam().aside_m, 0, GetParam().from_m};
  add_box({half_m + 5, 0, 0}, {5, 4, 0.125}), add_box({-half_m - 5, 0, 0}, {5, 4, 0.125});
  const uint64_t leaf = next_id_;
  double edge_m = half_m;
  add_box({edge_m + half_m, 0, 0}, {half_m, 4, 0.125});
  for (int i = 0; i < 90; ++i) {
    const bool moves = edge_m > -half_m;
    if (moves) edge_m -= leaf_mps * dt;
    const glm::dvec3 velocity_mps(moves ? -leaf_mps : 0.0, 0, 0);
    ASSERT_TRUE(mirror_.apply({}, {{leaf}, {Pose{{edge_m + half_m, 0, 0}, {1, 0, 0, 0}}}, {velocity_mps}, {}, {}}));
    gather();
    MoversAhead movers;
    for (size_t look = 0; look < movers.size(); ++look)
      movers[look].gather_movers(mirror_, camera_.pose.position_m, 8, {}, kEvadeS[look]);
    const glm::dvec3 wanted = clamp_velocity(camera_.velocity_mps, ahead_mps, limits_, dt);
    const SafeMove move = make_safe(camera_, evade(camera_, wanted, limits_, {}, movers, field_, dt), limits_, {},
                                    field_, dt);
    ASSERT_FALSE(move.overlap) << "after " << i * dt << " s";
    camera_ = moved(camera_, move.velocity_mps, dt);
  }
  EXPECT_GT(std::abs(camera_.pose.position_m.z), 0.125 + limits_.body_radius_m);
}
INSTANTIATE_TEST_SUITE_P(Speeds, Doorway,
                         testing::Values(Passage{0, 0}, Passage{1, 0}, Passage{2, 0}, Passage{3.5, 0.6},
                                         Passage{3.5, 1.2}, Passage{3.75, 1.2, 0.2}, Passage{4.25, 1.6, 0.1},
                                         Passage{4.5, 1.7, 0.1}));

TEST_F(Body, NearPlaneCornersBelongToTheBody) {
  CameraLimits small;
  small.body_radius_m = 0.01;
  Lens lens;
  lens.near_m = 0.5;
  EXPECT_DOUBLE_EQ(swept_radius_m(small, lens), near_corner_distance_m(lens));
}

}  // namespace
}  // namespace sightline
