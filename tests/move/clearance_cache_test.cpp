#include "server/move/clearance_cache.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/scene/primitives.h"
#include "tests/support/triangle_soup.h"

namespace sightline {
namespace {

using namespace test;

constexpr double kBodyM = 0.35;

// Meshes of random triangles around the origin, one of which moves, and a bound that a lattice covers.
struct Place {
  Draw draw{21};
  SceneMirror mirror;
  Lattice lattice;
  Bound bound;
  ClearanceCache clearance_cache;
  std::vector<glm::dvec3> position_m;
  uint64_t next_id = 1;

  Place() {
    bound.radius_m = 1.25;
    for (int i = 0; i < 4; ++i) grow();
    grow(true);
    cover();
  }
  uint64_t grow(bool moving = false) {
    NewInstance made = placed(next_id, random_soup(draw, 60), {draw.vec(3), draw.rotation()});
    made.moving = moving;
    add(mirror, std::move(made));
    return next_id++;
  }
  void go(uint64_t id) {
    TransformUpdate update;
    update.ids = {id};
    update.poses = {Pose{draw.vec(3), draw.rotation()}};
    update.velocities_mps = {glm::dvec3(1, 0, 0)};
    ASSERT_TRUE(mirror.apply({}, update));
  }
  void change(uint64_t id, const InstanceAttributes& attributes) {
    SceneDelta delta;
    delta.change = {{id, attributes}};
    ASSERT_TRUE(mirror.apply(delta, {}));
  }
  void remove(uint64_t id) {
    SceneDelta delta;
    delta.remove = {id};
    ASSERT_TRUE(mirror.apply(delta, {}));
  }
  // The lattice's cells and two other positions, one of them outside the bound.
  void cover(int candidates = 200) {
    lattice.cover(bound, candidates);
    position_m = lattice.positions_m();
    position_m.push_back(bound.center_m + draw.vec(0.5));
    position_m.push_back(bound.center_m + glm::dvec3(0, 0, 1.5 * bound.radius_m));
  }
  double reach_m() const { return std::max(1.75 * lattice.spacing_m(), kBodyM + 0.15); }

  void expect_exact() {
    const std::vector<glm::dvec3> before_m = position_m;
    const auto measured = clearance_cache.measure(mirror, lattice, bound, position_m, kBodyM);
    ASSERT_EQ(measured.size(), position_m.size());
    ClearanceField field;
    field.gather(mirror, {0, 0, 0}, 1000, mirror.moving_slots());
    for (size_t i = 0; i < position_m.size(); ++i)
      ASSERT_EQ(measured[i], static_cast<float>(field.clearance_m(position_m[i], reach_m()))) << "place " << i;
    expect_fitting(field, before_m, measured);
    position_m = before_m;
  }
  // Only cells where the body did not fit were moved, and now it does.
  void expect_fitting(const ClearanceField& field, const std::vector<glm::dvec3>& before_m,
                      std::span<const float> measured) {
    std::vector<uint32_t> moved;
    for (uint32_t i = 0; i < position_m.size(); ++i) {
      if (position_m[i] == before_m[i]) continue;
      moved.push_back(i);
      EXPECT_LT(i, lattice.size());
      EXPECT_LT(field.clearance_m(before_m[i], 10.0), kBodyM);
      EXPECT_GE(measured[i], static_cast<float>(kBodyM) - 1e-6f);
      EXPECT_LE(glm::distance(position_m[i], before_m[i]), 0.5 * lattice.spacing_m() + 1e-6);
      EXPECT_TRUE(bound.contains(position_m[i]));
      EXPECT_EQ(field.free_fraction(before_m[i], position_m[i], 1e-4), 1.0);
    }
    EXPECT_TRUE(std::ranges::equal(clearance_cache.moved(), moved));
  }
};

TEST(ClearanceCache, IsTheClearanceWhileTheLatticeTravels) {
  Place place;
  const glm::dvec3 step(0.31, -0.07, 0.19);
  for (int i = 0; i < 40; ++i) {
    place.bound.center_m += i < 20 ? step : -step;
    place.cover();
    place.expect_exact();
  }
}

TEST(ClearanceCache, IsTheClearanceAfterTheLatticeIsLaidAgain) {
  Place place;
  for (const double radius : {1.25, 0.4, 2.5, 1.25, 0.05, 1.25}) {
    place.bound.radius_m = radius;
    place.cover();
    place.expect_exact();
  }
  for (const int candidates : {27, 400, 27}) {
    place.cover(candidates);
    place.expect_exact();
  }
}

TEST(ClearanceCache, FollowsWhatIsAddedRemovedHiddenAndFirstMoved) {
  Place place;
  place.expect_exact();
  place.grow();
  place.expect_exact();
  place.remove(2);
  place.expect_exact();
  place.change(3, {.collides = false});
  place.expect_exact();
  place.change(3, {.visible = false});
  place.expect_exact();
  place.change(3, {});
  place.expect_exact();
  place.go(4);  // it was static until now
  place.expect_exact();
  for (int i = 0; i < 10; ++i) {
    place.go(4), place.go(5);
    place.expect_exact();
  }
  place.remove(4), place.remove(5);
  place.expect_exact();
}

// Random triangles so large and so many that each place is inside of the boxes of thousands.
std::shared_ptr<const Geometry> dense_soup(Draw& draw, uint32_t triangles, double size_m) {
  MeshData mesh;
  for (uint32_t t = 0; t < triangles; ++t) {
    const glm::dvec3 at = draw.vec(3);
    for (uint32_t k = 0; k < 3; ++k) {
      mesh.positions.emplace_back(at + draw.vec(size_m));
      mesh.indices.push_back(3 * t + k);
    }
  }
  return build_geometry(std::move(mesh)).value();
}

// The work of each call is bounded, and its result is that of a cache that never saw another bound: a session that goes
// on from its recorded memory has a new one.
TEST(ClearanceCache, AmongVeryManyTrianglesItIsBoundedAndTheSameWhateverWasBefore) {
  for (const double size_m : {0.3, 1.0, 4.0}) {
    Place place;
    add(place.mirror, placed(place.next_id++, dense_soup(place.draw, 60'000, size_m)));
    size_t without_room = 0, with_room = 0;
    for (int i = 0; i < 8; ++i) {
      place.bound.center_m += glm::dvec3(0.21, -0.07, 0.13) * (i < 5 ? 1.0 : -1.0);
      place.cover();
      ClearanceCache fresh;
      std::vector<glm::dvec3> travelled_m = place.position_m, fresh_m = place.position_m;
      const auto a = place.clearance_cache.measure(place.mirror, place.lattice, place.bound, travelled_m, kBodyM);
      const auto b = fresh.measure(place.mirror, place.lattice, place.bound, fresh_m, kBodyM);
      ASSERT_TRUE(std::ranges::equal(a, b)) << i;
      ASSERT_EQ(travelled_m, fresh_m) << i;
      const uint64_t cells = place.lattice.size();
      EXPECT_LE(fresh.tests(), 2 * (ClearanceCache::kTestsOfLattice + cells * ClearanceCache::kTestsOfCells +
                                    ClearanceCache::kTestsOfCell) +
                                   4 * ClearanceCache::kTestsOfCell);
      without_room += std::ranges::count(a, 0.0f);
      with_room += a.size() - std::ranges::count(a, 0.0f);
    }
    if (size_m < 1) {
      EXPECT_GT(with_room, 0u);
    }
    if (size_m > 1) {
      EXPECT_GT(without_room, 0u);
    }
  }
}

TEST(ClearanceCache, LeavesOutWhatMoves) {
  Place still, moving;
  moving.grow(true);
  const auto a = still.clearance_cache.measure(still.mirror, still.lattice, still.bound, still.position_m, kBodyM);
  const auto b = moving.clearance_cache.measure(moving.mirror, moving.lattice, moving.bound, moving.position_m, kBodyM);
  EXPECT_TRUE(std::equal(a.begin(), a.end(), b.begin(), b.end()));
}

TEST(ClearanceCache, EndsWhereItIsCutOff) {
  Place place;
  for (uint64_t id = 1; id <= 5; ++id) place.remove(id);
  for (const float clearance :
       place.clearance_cache.measure(place.mirror, place.lattice, place.bound, place.position_m, kBodyM))
    EXPECT_EQ(clearance, static_cast<float>(place.reach_m()));
  place.expect_exact();
}

// A wide body on a fine lattice. The capped clearance must still show whether there is room for it.
TEST(ClearanceCache, SeesFartherThanTheBodyIsWide) {
  Place place;
  place.bound.radius_m = 0.05;
  place.cover();
  for (uint64_t id = 1; id <= 5; ++id) place.remove(id);
  for (const double body_m : {0.0, 1.0, 10.0})
    for (const float clearance :
         place.clearance_cache.measure(place.mirror, place.lattice, place.bound, place.position_m, body_m))
      EXPECT_GT(clearance, body_m);
}

// Both bodies are so small that clearances are capped at the same distance.
TEST(ClearanceCache, MeasuresAgainForABodyOfAnotherSize) {
  Place place;
  ASSERT_GT(1.75 * place.lattice.spacing_m(), 0.3 + 0.15);
  size_t moved = 0;
  for (const double body_m : {0.1, 0.3, 0.1}) {
    std::vector<glm::dvec3> position_m = place.position_m, fresh_m = place.position_m;
    ClearanceCache fresh;
    const auto expected = fresh.measure(place.mirror, place.lattice, place.bound, fresh_m, body_m);
    const auto measured = place.clearance_cache.measure(place.mirror, place.lattice, place.bound, position_m, body_m);
    EXPECT_TRUE(std::equal(measured.begin(), measured.end(), expected.begin(), expected.end())) << body_m;
    EXPECT_EQ(position_m, fresh_m) << body_m;
    moved += fresh.moved().size();
  }
  EXPECT_GT(moved, 0u);
}

// A doorway that is 0.12 m wider and higher than the body needs. Wherever the points of the lattice lie, cells lead
// through it.
TEST(ClearanceCache, MovesPlacesToWhereTheBodyFitsInADoorway) {
  constexpr double kHalfM = kBodyM + 0.06;
  for (const double shift_m : {0.0, 0.05, 0.1, 0.15, 0.2, 0.25}) {
    SceneMirror mirror;
    const glm::dvec3 door_m(shift_m, 0.7 * shift_m, 0);
    uint64_t id = 1;
    for (const glm::dvec3 side : {glm::dvec3(1, 0, 0), glm::dvec3(-1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, -1, 0)})
      add(mirror, placed(id++, build_geometry(*tessellate(BoxShape{glm::vec3(5, 5, 0.2)})).value(),
                         {door_m + (5 + kHalfM) * side, glm::dquat(1, 0, 0, 0)}));
    Bound bound;
    bound.radius_m = 1.5;
    Lattice lattice;
    lattice.cover(bound, 150);
    ASSERT_GT(lattice.spacing_m(), 0.4) << "coarser than the doorway's free width";
    std::vector<glm::dvec3> position_m = lattice.positions_m();
    ClearanceCache clearance_cache;
    const auto clearance_m = clearance_cache.measure(mirror, lattice, bound, position_m, kBodyM);
    size_t inside = 0;
    for (size_t i = 0; i < position_m.size(); ++i)
      inside += std::abs(position_m[i].z) < 0.2 &&
                glm::all(glm::lessThan(glm::abs(position_m[i] - door_m), glm::dvec3(kHalfM))) &&
                clearance_m[i] >= kBodyM;
    EXPECT_GT(inside, 0u) << "shifted by " << shift_m;
  }
}

}  // namespace
}  // namespace sightline
