// The points of a target of several pieces: how many each piece has, and which ones.
#include "server/step/target_points.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/base/random.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

constexpr uint64_t kFirstId = 1;

// Pieces of one target, each with the points of its shape.
struct Body {
  uint32_t add(const Shape& shape, const glm::dvec3& at_m) {
    const auto geometry = *store.intern(*tessellate(shape));
    SceneDelta delta;
    delta.add.push_back({kFirstId + pieces.size(), geometry, Pose{at_m, {1, 0, 0, 0}}, glm::dmat3(1.0), {}});
    EXPECT_TRUE(mirror.apply(delta, {}));
    tables.push_back(ExtentTable::build(*geometry));
    pieces.push_back({*mirror.slot_of(kFirstId + pieces.size()), tables.back().get()});
    return pieces.back().slot;
  }
  // The places in the piece's list of points of those that were picked of it, in their order.
  std::vector<size_t> picked_of(const TargetPiece& piece, const TargetView& view,
                                std::span<const TargetPoint> picked) const {
    const Affine mesh_from_world = inverse(mirror.instances()[piece.slot].world_from_instance);
    const auto points = piece.table->points(transform_point(mesh_from_world, view.viewer_m));
    std::vector<size_t> at;
    for (const TargetPoint& point : picked)
      if (point.slot == piece.slot)
        at.push_back(static_cast<size_t>(std::find(points.begin(), points.end(), point.at_m) - points.begin()));
    return at;
  }

  GeometryStore store;
  SceneMirror mirror;
  std::vector<std::shared_ptr<const ExtentTable>> tables;
  std::vector<TargetPiece> pieces;
  TargetPicker picker;
};

// Two equal boxes side by side show equal areas. Neither hides the other, so no point of a piece's list is passed over,
// not even one on a face that the box itself hides from this viewer.
TEST(TargetPoints, PiecesThatHideNothingOfEachOtherAreUsedPointByPointRoundAfterRound) {
  CounterRandom random(81, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 20; ++trial) {
    Body body;
    body.add(BoxShape{{0.3f, 0.4f, 0.3f}}, {-1.5, 0, 0}), body.add(BoxShape{{0.3f, 0.4f, 0.3f}}, {1.5, 0, 0});
    const double turn_rad = random.next_in(-0.6, 0.6);
    TargetView view{.viewer_m = glm::dvec3(20 * std::sin(turn_rad), random.next_in(-6, 6), 20 * std::cos(turn_rad)),
                    .count = 8};
    std::vector<std::set<size_t>> used(2);
    for (view.round = 0; view.round < 16; ++view.round) {
      const auto picked = body.picker.pick(body.mirror, body.pieces, view);
      ASSERT_EQ(picked.size(), 8u);
      for (size_t k = 0; k < 2; ++k) {
        const std::vector<size_t> at = body.picked_of(body.pieces[k], view, picked);
        EXPECT_NEAR(static_cast<double>(at.size()), 4.0, 1.0) << "half of the points";
        for (size_t i = 0; i < at.size(); ++i)
          EXPECT_EQ(at[i], (at[0] + i) % kExtentPoints) << "trial " << trial << ", round " << view.round;
        used[k].insert(at.begin(), at.end());
      }
    }
    for (size_t k = 0; k < 2; ++k)
      EXPECT_GT(used[k].size(), kExtentPoints * 4 / 5) << "trial " << trial << ", piece " << k;
  }
}

// The near board hides the lower half of the far one, so every point of the far one lies in its upper half.
TEST(TargetPoints, APointThatAnotherPieceHidesIsReplaced) {
  Body body;
  const uint32_t far = body.add(BoxShape{{1.0f, 1.0f, 0.01f}}, {0, 0, 0}),
                 near = body.add(BoxShape{{2.0f, 1.0f, 0.01f}}, {0, -1, 1});
  TargetView view{.viewer_m = {0, 0, 200}, .count = 16};
  size_t of_far = 0, of_near = 0;
  for (view.round = 0; view.round < 8; ++view.round)
    for (const TargetPoint& point : body.picker.pick(body.mirror, body.pieces, view)) {
      EXPECT_TRUE(point.slot != far || point.at_m.y >= -0.02f) << point.at_m.y;
      of_far += point.slot == far, of_near += point.slot == near;
    }
  EXPECT_EQ(of_far + of_near, 128u);
  EXPECT_NEAR(static_cast<double>(of_near) / static_cast<double>(of_far), 4.0, 1.2) << "it shows four times as much";
}

}  // namespace
}  // namespace sightline
