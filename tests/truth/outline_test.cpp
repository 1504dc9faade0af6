// How much of a body the picture holds, against solid angles in closed form and against a grid of rays with an analytic
// sphere.
#include "client/truth/outline.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "client/truth/truth.h"
#include "server/base/random.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

class Bench {
 public:
  Bench() : occluders_(device_, EmbreeScene::Content::kOccluders) {}

  uint32_t add(uint64_t id, const Shape& shape, const glm::dvec3& at_m) {
    SceneDelta delta;
    delta.add.push_back({id, *store_.intern(*tessellate(shape)), Pose{at_m, {1, 0, 0, 0}}, glm::dmat3(1.0), {}});
    EXPECT_TRUE(mirror_.apply(delta, {}));
    occluders_.take_in(mirror_);
    return *mirror_.slot_of(id);
  }
  Outline outline(std::vector<uint32_t> slots) const {
    return measure_outline(occluders_, mirror_.instances(), slots, camera, lens);
  }
  TargetTruth look(uint64_t id) const {
    Target target;
    target.instance_id = id;
    PictureTruth picture = measure_picture(occluders_, mirror_, {&target, 1}, camera, lens);
    add_outlines(occluders_, mirror_, {&target, 1}, camera, lens, picture);
    return picture.targets[0];
  }

  Pose camera;
  Lens lens;

 private:
  GeometryStore store_;
  SceneMirror mirror_;
  EmbreeDevice device_;
  EmbreeScene occluders_;
};

double half_height(const Lens& lens) {
  return std::tan(lens.vertical_fov_rad / 2);
}

TEST(Outline, OfABodyInThePictureIsAllInside) {
  Bench bench;
  const Outline outline = bench.outline({bench.add(1, BoxShape{{0.3f, 0.9f, 0.01f}}, {0, 0, -6})});
  EXPECT_EQ(outline.in_picture_share, 1.0);
  EXPECT_NEAR(outline.height_pictures, 1.8 / (2 * 6 * half_height(bench.lens)), 0.02);
}

// A flat body at the upper edge: its lower half is nearer to the eye, so it is a little more than half.
TEST(Outline, OfABodyCutAtItsMiddleIsHalfInside) {
  Bench bench;
  const double edge_m = 10 * half_height(bench.lens);
  const uint32_t slot = bench.add(1, BoxShape{{0.3f, 0.9f, 0.01f}}, {0, edge_m, -10});
  double all_sr = 0, lower_sr = 0;
  for (double y_m = -0.895; y_m < 0.9; y_m += 0.01) {
    const double row_sr = std::pow(100 + (edge_m + y_m) * (edge_m + y_m), -1.5);
    all_sr += row_sr, lower_sr += y_m < 0 ? row_sr : 0;
  }
  EXPECT_NEAR(bench.outline({slot}).in_picture_share, lower_sr / all_sr, 0.01);
  EXPECT_NEAR(bench.outline({slot}).height_pictures, 1.8 / (2 * edge_m), 0.02);
}

TEST(Outline, OfABodyBehindTheCameraOrBeforeTheNearPlaneIsOutside) {
  Bench bench;
  EXPECT_EQ(bench.outline({bench.add(1, SphereShape{0.5f}, {0, 0, 6})}).in_picture_share, 0.0);
  bench.lens.near_m = 3;
  EXPECT_EQ(bench.outline({bench.add(2, SphereShape{0.5f}, {0, 0, -2})}).in_picture_share, 0.0);
}

TEST(Outline, RoundAnEyeInsideTheBodyIsTheSolidAngleOfThePicture) {
  Bench bench;
  bench.lens.near_m = 0.01;
  const uint32_t slot = bench.add(1, SphereShape{1.0f}, {0.1, 0, 0.05});
  const double h = half_height(bench.lens), w = h * bench.lens.aspect;
  const double picture_sr = 4 * std::asin(w * h / std::sqrt((1 + w * w) * (1 + h * h)));
  EXPECT_NEAR(bench.outline({slot}).in_picture_share, picture_sr / (4 * std::numbers::pi), 0.01);
}

// Of two equal bodies, of which the picture holds one.
TEST(Outline, IsOfAllPartsTogether) {
  Bench bench;
  const uint32_t inside = bench.add(1, SphereShape{0.5f}, {0, 0, -8}),
                 outside = bench.add(2, SphereShape{0.5f}, {8, 0, 0});
  EXPECT_NEAR(bench.outline({inside, outside}).in_picture_share, 0.5, 0.03);
}

// Cells of a grid on all six sides of a cube, each with its solid angle.
TEST(Outline, AgreesWithAGridOfRaysAllRound) {
  constexpr int kCells = 300;
  CounterRandom random(3, 0, RandomPurpose::kTest);
  const auto in = [&](double low, double high) { return random.next_in(low, high); };
  for (int round = 0; round < 20; ++round) {
    Bench bench;
    bench.lens.vertical_fov_rad = in(0.4, 1.6);
    bench.lens.aspect = in(0.6, 2.2);
    const double radius_m = in(0.3, 1.0);
    const glm::dvec3 center_m(in(-3, 3), in(-2, 2), in(-4, -1.2));
    const double h = half_height(bench.lens), w = h * bench.lens.aspect;
    double all_sr = 0, inside_sr = 0;
    for (int axis = 0; axis < 3; ++axis)
      for (const double side : {-1.0, 1.0})
        for (int a = 0; a < kCells; ++a)
          for (int b = 0; b < kCells; ++b) {
            glm::dvec3 direction;
            direction[axis] = side, direction[(axis + 1) % 3] = 2 * (a + 0.5) / kCells - 1,
            direction[(axis + 2) % 3] = 2 * (b + 0.5) / kCells - 1;
            const double length = glm::length(direction), cell_sr = 1 / (length * length * length);
            const double along_m = glm::dot(center_m, direction) / length;
            if (along_m < 0 || glm::dot(center_m, center_m) - along_m * along_m > radius_m * radius_m) continue;
            all_sr += cell_sr;
            if (direction.z < 0 && std::abs(direction.x) <= -direction.z * w &&
                std::abs(direction.y) <= -direction.z * h)
              inside_sr += cell_sr;
          }
    EXPECT_NEAR(bench.outline({bench.add(1, SphereShape{static_cast<float>(radius_m)}, center_m)}).in_picture_share,
                inside_sr / all_sr, 0.02)
        << round;
  }
}

TEST(Outline, ATargetIsShownWholeOnlyIfNothingHidesItOrCutsItOff) {
  Bench bench;
  bench.add(1, BoxShape{{0.3f, 0.9f, 0.3f}}, {0, 0, -6});
  EXPECT_TRUE(bench.look(1).shown_whole());
  EXPECT_EQ(bench.look(1).whole_share(), 1.0);
  bench.camera.position_m = {0, -0.6, -5};  // 1 m from it, at its legs: all of the part inside is visible
  EXPECT_EQ(bench.look(1).visible_share(), 1.0);
  EXPECT_FALSE(bench.look(1).shown_whole());
  EXPECT_LT(bench.look(1).whole_share(), 0.6);
  EXPECT_GT(bench.look(1).outline.height_pictures, 1.0);
  bench.camera.position_m = {};
  bench.add(2, BoxShape{{1.0f, 0.9f, 0.01f}}, {0, -0.9, -5});  // before its lower half
  EXPECT_FALSE(bench.look(1).shown_whole());
  EXPECT_NEAR(bench.look(1).whole_share(), 0.5, 0.1);
}

}  // namespace
}  // namespace sightline
