// The search for a free way, in scenes whose ways are known.
#include "client/truth/free_way.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "scenes/glb_writer.h"
#include "server/scene/gltf.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

constexpr double kBodyM = 0.3;

// A closed box of 4 x 3 x 4 m round the origin holds the camera. A slot of `slot_m`, as high as the box, opens it in
// the middle of the side at -x. The target stands 6 m away at +x. With `lid_s`, a lid closes the slot but from lid_s.x
// to lid_s.y.
struct Place {
  GeometryStore store;
  EmbreeDevice device;
  std::unique_ptr<Scenario> scenario;
  std::unique_ptr<ScenarioWorld> world;

  explicit Place(float slot_m, const glm::vec2* lid_s = nullptr) {
    scenes::GlbWriter writer;
    add_box(writer, "floor", {0, -1.6f, 0}, {2.1f, 0.1f, 2.1f});
    add_box(writer, "ceiling", {0, 1.6f, 0}, {2.1f, 0.1f, 2.1f});
    add_box(writer, "left", {0, 0, -2.05f}, {2.1f, 1.5f, 0.05f});
    add_box(writer, "right", {0, 0, 2.05f}, {2.1f, 1.5f, 0.05f});
    add_box(writer, "front", {2.05f, 0, 0}, {0.05f, 1.5f, 2});
    const float half_m = (2 - slot_m / 2) / 2;
    add_box(writer, "back left", {-2.05f, 0, -2 + half_m}, {0.05f, 1.5f, half_m});
    add_box(writer, "back right", {-2.05f, 0, 2 - half_m}, {0.05f, 1.5f, half_m});
    const int person = writer.add_mesh("person", *tessellate(CapsuleShape{0.3f, 0.6f}), {1, 1, 1});
    writer.add_node({"anna", -1, person, -1, {6, 0, 0}, {1, 0, 0, 0}, role("target")});
    writer.add_node({"eye", -1, -1, writer.add_camera(0.8, 1.5, 0.1), {0, 0, 0}, {1, 0, 0, 0}, role("camera")});
    if (lid_s) add_lid(writer, *lid_s);
    scenario = std::make_unique<Scenario>(*Scenario::from_asset(*read_gltf(writer.finish("scenario"), nullptr, store)));
    world = *ScenarioWorld::make(*scenario, store, device);
  }

  std::optional<FreeWay> way(double reach_m, const glm::dvec3& from_m = {0, 0, 0}) const {
    return find_free_way(*world, from_m, kBodyM, reach_m);
  }

 private:
  static nlohmann::ordered_json role(const char* name) { return {{"sightline", {{"role", name}}}}; }
  static void add_box(scenes::GlbWriter& writer, const char* name, const glm::vec3& at, const glm::vec3& half) {
    const int mesh = writer.add_mesh(name, *tessellate(BoxShape{half}), {1, 1, 1});
    writer.add_node({name, -1, mesh, -1, at, {1, 0, 0, 0}, {}});
  }
  static void add_lid(scenes::GlbWriter& writer, const glm::vec2& open_s) {
    const int mesh = writer.add_mesh("lid", *tessellate(BoxShape{{0.05f, 1.5f, 2}}), {1, 1, 1});
    const glm::vec3 shut(-2.2f, 0, 0), away(-2.2f, 40, 0);
    const int lid = writer.add_node({"lid", -1, mesh, -1, shut, {1, 0, 0, 0}, role("occluder")});
    const float blink_s = 0.01f;
    writer.animate(lid, std::vector<float>{0, open_s.x - blink_s, open_s.x, open_s.y - blink_s, open_s.y, 10},
                   std::vector<glm::vec3>{shut, shut, away, away, shut, shut},
                   std::vector<glm::quat>(6, glm::quat(1, 0, 0, 0)));
  }
};

TEST(FreeWay, LeadsOutThroughASlotThatTheBodyFits) {
  const Place place(1.2f);
  const auto way = place.way(20);
  ASSERT_TRUE(way);
  EXPECT_EQ(way->target_id, place.scenario->targets()[0].id);
  // The way leads out through the slot at x = -2.1 and past a corner of the box at |z| = 2.1 or y = 1.7. Then x = 6 is
  // in sight.
  EXPECT_LT(way->end_m.x, 6.0);
  const bool beside = std::abs(way->end_m.z) > 2.1, above = std::abs(way->end_m.y) > 1.7;
  EXPECT_TRUE(beside || above);
  EXPECT_GT(way->length_m, 2.1 + 1.7) << "to the slot, and up";
  EXPECT_LT(way->length_m, 12.0);
}

TEST(FreeWay, ASlotNarrowerThanTheBodyIsNone) {
  EXPECT_FALSE(Place(0.55f).way(20));
  EXPECT_FALSE(Place(0.0f).way(20));
}

TEST(FreeWay, IsNoLongerThanTheReach) {
  const Place place(1.2f);
  const double length_m = place.way(20)->length_m;
  EXPECT_TRUE(place.way(length_m + 1e-6));
  EXPECT_FALSE(place.way(length_m - 0.1));
}

TEST(FreeWay, HasNoLengthWhereTheTargetIsInSight) {
  const Place place(1.2f);
  const auto way = place.way(20, {3, 0, 0});
  ASSERT_TRUE(way);
  EXPECT_EQ(way->length_m, 0.0);
  EXPECT_EQ(way->end_m, glm::dvec3(3, 0, 0));
}

// From 0.2 m behind the wall, in reach of the body's own radius, no cell beyond the wall may be entered.
TEST(FreeWay, DoesNotPassThroughAWallThatTheCameraTouches) {
  EXPECT_FALSE(Place(0.0f).way(20, {1.8, 0, 0}));
  EXPECT_FALSE(Place(0.0f).way(20, {1.99, 0, 0.01}));
}

// The search goes along the axes, so the length is the sum of the distances along them.
TEST(FreeWay, LengthsAreAlongTheSidesOfTheCells) {
  const Place place(0.0f);
  // The camera is behind the box at x = -6. No place is in sight until z is beyond the box's shadow, which widens
  // backwards. Its edge runs from the target over the box's edges at x = 2.1.
  const auto way = place.way(20, {-6, 0, 0});
  ASSERT_TRUE(way);
  const glm::dvec3 moved = way->end_m - glm::dvec3(-6, 0, 0);
  EXPECT_NEAR(way->length_m, std::abs(moved.x) + std::abs(moved.y) + std::abs(moved.z), 1e-9);
}

// Behind the box with nothing else in the way, the nearest place in sight is the one of the fewest cells that a plain
// search of all cells finds.
TEST(FreeWay, IsTheShortestOfAll) {
  const Place place(0.0f);
  const glm::dvec3 from_m(-4, 0, 0);
  const auto way = place.way(6, from_m);
  ASSERT_TRUE(way);
  const Target& target = place.world->targets()[0];
  const uint32_t own = *place.world->mirror().slot_of(target.instance_id);
  RayFilter others;
  others.ignored_slots = std::span(&own, 1);
  const glm::dvec3 aim_m = aim_point_m(*place.world->mirror().find(target.instance_id));
  constexpr int kReach = 20;
  int fewest = 100;
  for (int x = -kReach; x <= kReach; ++x)
    for (int y = -kReach; y <= kReach; ++y)
      for (int z = -kReach; z <= kReach; ++z) {
        const glm::dvec3 at_m = from_m + kBodyM * glm::dvec3(x, y, z);
        const int steps = std::abs(x) + std::abs(y) + std::abs(z);
        if (steps >= fewest || place.world->colliders().nearest_surface_m(at_m, 1.0f) < std::hypot(kBodyM, kBodyM / 2))
          continue;
        if (place.world->occluders().trace(aim_m, glm::vec3(at_m - aim_m), 0.0f, 1.0f, others).slot == UINT32_MAX)
          fewest = steps;
      }
  EXPECT_NEAR(way->length_m, kBodyM * fewest, 1e-9);
  EXPECT_GT(fewest, 3);
}

TEST(FreeWay, ReachFromRestIsHalfTheAccelerationTimesTheSquareThenTheSpeed) {
  const CameraLimits limits;  // 10 m/s, 10 m/s^2
  EXPECT_NEAR(reach_from_rest_m(limits, 0.5), 1.25, 1e-9);
  EXPECT_NEAR(reach_from_rest_m(limits, 1.0), 5.0, 1e-9);
  EXPECT_NEAR(reach_from_rest_m(limits, 2.0), 15.0, 1e-9);
}

// ---- blind although a way exists ----

// A camera stays in the box for 8 s and sees no target. There is a picture every 0.1 s. The pictures in `seen` show one
// pixel.
double blind_with_way_s(Place& place, const std::vector<int>& seen = {}) {
  std::vector<CameraFrame> frames;
  std::vector<FrameTruth> truths;
  for (int k = 0; k <= 80; ++k) {
    CameraFrame& frame = frames.emplace_back();
    frame.time_s = 0.1 * k;
    FrameTruth& truth = truths.emplace_back();
    const bool sees = std::find(seen.begin(), seen.end(), k) != seen.end();
    truth.picture.emplace();
    truth.picture->targets.push_back({1, 100, sees ? 1u : 0u, true});
  }
  return longest_blind_with_way_s(*place.world, frames, truths, CameraLimits{});
}

TEST(BlindWithAWay, IsAllOfTheStretchWhereAWayStaysOpen) {
  Place open(1.2f), shut(0.0f);
  EXPECT_NEAR(blind_with_way_s(open), 8.0, 1e-9);
  EXPECT_EQ(blind_with_way_s(shut), 0.0);
  EXPECT_NEAR(blind_with_way_s(open, {50}), 5.0, 1e-9);
}

TEST(BlindWithAWay, LastsWhileTheDoorIsOpen) {
  const glm::vec2 open_s(2.0f, 5.0f);
  Place place(1.2f, &open_s);
  EXPECT_NEAR(blind_with_way_s(place), 3.0, kFreeWayEveryS + 1e-9);
  EXPECT_NEAR(blind_with_way_s(place, {30}), 2.0, kFreeWayEveryS + 1e-9) << "from 3.1 s to 5 s";
}

}  // namespace
}  // namespace sightline
