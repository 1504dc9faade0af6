#include "server/aggregate/temporal_volume.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <tuple>

#include "tests/support/plain_past.h"

namespace sightline {
namespace {

constexpr double kDt = 1.0 / 60;

Bound ball(const glm::dvec3& center, double radius) {
  Bound bound;
  bound.center_m = center;
  bound.radius_m = radius;
  return bound;
}

FilterSettings joint(int n, double alpha) {
  FilterSettings s;
  s.mode = FilterMode::kJoint, s.n = n, s.alpha = alpha;
  return s;
}

FilterSettings none() {
  FilterSettings s;
  s.mode = FilterMode::kNone;
  return s;
}

// A lattice over a bound, and the filter's answers for its cells.
struct Fixture {
  Lattice lattice;
  TemporalVolume volume;
  std::vector<uint32_t> out;
  std::vector<uint64_t> ids{100, 200};
  int window = 0;  // of the last step, in steps

  void step(const Bound& bound, const std::vector<uint32_t>& visible, const FilterSettings& settings) {
    lattice.cover(bound, 125);
    volume.begin_step(lattice, 0, ids, settings, kDt);
    volume.push(lattice, visible);
    volume.filter(lattice.addresses(), visible, 0xFFFFFFFF, out);
    window = settings.mode == FilterMode::kNone    ? 1
             : settings.mode == FilterMode::kJoint ? settings.n
                                                   : filter_steps(settings, kDt).window;
  }
  // The share of the steps in the window in which a cell saw a target.
  float share(size_t cell, size_t target) {
    return visible_share(volume.history().records(lattice.addresses()[cell])[target], window).share();
  }
  // All cells see the same.
  void step(uint32_t visible, const FilterSettings& settings) {
    lattice.cover(ball(glm::dvec3(0.0), 1.0), 125);
    step(ball(glm::dvec3(0.0), 1.0), std::vector<uint32_t>(lattice.addresses().size(), visible), settings);
  }
};

using Place = std::tuple<int, int, int>;
Place place_of(const Lattice& lattice, size_t i) {
  const glm::dvec3 p = glm::round(lattice.positions_m()[i] / lattice.spacing_m());
  return {static_cast<int>(p.x), static_cast<int>(p.y), static_cast<int>(p.z)};
}

// The reference: every lattice point of the world has a list for each target. Entries are unknown while the bound is
// elsewhere. A point loses its lists when another point takes over its address.
class PlainWorld {
 public:
  void begin_step() {
    for (auto& [place, pasts] : pasts_)
      for (PlainPast& past : pasts) past.push_back(Seen::kUnknown);
  }
  void push(const Place& place, uint32_t address, uint32_t visible) {
    const auto [owner, added] = owner_.try_emplace(address, place);
    if (!added && owner->second != place) pasts_.erase(owner->second), owner->second = place;
    auto& pasts = pasts_[place];
    if (pasts.empty()) pasts.assign(2, PlainPast(1));
    for (int t = 0; t < 2; ++t) pasts[t].back() = visible >> t & 1u ? Seen::kVisible : Seen::kHidden;
  }
  const std::vector<PlainPast>& pasts(const Place& place) { return pasts_[place]; }

 private:
  std::map<Place, std::vector<PlainPast>> pasts_;
  std::map<uint32_t, Place> owner_;
};

TEST(TemporalVolume, IsThePlainFilterOfEveryPlaceUnderAMovingBound) {
  CounterRandom random(1, 0, RandomPurpose::kTest);
  Fixture f;
  PlainWorld world;
  int returned = 0, forgotten_with_past = 0;
  for (int step = 0; step < 400; ++step) {
    // The bound moves back and forth, so that cells leave and return, some after another cell used their address.
    const Bound bound = ball({1.7 * std::sin(0.05 * step), 0.3 * std::sin(0.013 * step), 0.1}, 1.0);
    const FilterSettings settings = joint(1 + static_cast<int>(random.next_below(64)), random.next_unit());
    f.lattice.cover(bound, 125);
    std::vector<uint32_t> visible;
    for (size_t i = 0; i < f.lattice.addresses().size(); ++i)
      visible.push_back(random.next_below(8) | random.next_below(4));
    f.step(bound, visible, settings);
    world.begin_step();
    for (size_t i = 0; i < visible.size(); ++i) {
      const Place place = place_of(f.lattice, i);
      world.push(place, f.lattice.addresses()[i], visible[i] & 3u);
      const auto& pasts = world.pasts(place);
      const PlainState plain = plain_joint(pasts, settings.n, settings.alpha);
      for (int t = 0; t < 2; ++t) {
        ASSERT_EQ(f.out[i] >> t & 1u, plain.visible[t] ? 1u : 0u) << "step " << step;
        float seen = 0, known = 0;
        for (int k = 0; k < settings.n; ++k)
          seen += steps_before(pasts[t], k) == Seen::kVisible, known += steps_before(pasts[t], k) != Seen::kUnknown;
        ASSERT_FLOAT_EQ(f.share(i, t), seen / known);
      }
      if (pasts[0].size() > 5 && steps_before(pasts[0], 1) == Seen::kUnknown) ++returned;
      if (pasts[0].size() == 1 && step > 100) ++forgotten_with_past;
    }
  }
  EXPECT_GT(returned, 500) << "the walk must bring cells back";
  EXPECT_GT(forgotten_with_past, 1000) << "and let others take their address";
}

TEST(TemporalVolume, PerTargetIsTheDefaultAndKeepsASteadyTargetBesideAFlickeringOne) {
  Fixture steady, paper;
  for (int i = 0; i < 60; ++i) {
    steady.step(i % 2 == 0 ? 0b11 : 0b01, {});
    paper.step(i % 2 == 0 ? 0b11 : 0b01, joint(10, 0.6));
  }
  for (size_t i = 0; i < steady.out.size(); ++i) {
    EXPECT_TRUE(steady.out[i] & 1u);
    EXPECT_EQ(paper.out[i], 0u);
    EXPECT_FLOAT_EQ(steady.share(i, 0), 1.0f);
    EXPECT_NEAR(steady.share(i, 1), 0.5, 0.04);
  }
}

TEST(TemporalVolume, WithoutAFilterTheNewestStepAloneCounts) {
  Fixture f;
  for (const uint32_t visible : {3u, 0u, 1u, 2u, 3u, 1u}) {
    f.step(visible, none());
    EXPECT_EQ(f.out[0], visible);
    EXPECT_FLOAT_EQ(f.share(0, 1), visible >> 1 ? 1.0f : 0.0f);
  }
}

TEST(TemporalVolume, TargetsKeepTheirPastByIdWhereverTheyStandInTheList) {
  Fixture f;
  for (int i = 0; i < 20; ++i) f.step(0b01, {});
  f.ids = {300, 200, 100};  // 300 is new
  f.step(0b001, {});        // now 300 is seen, and the one that was seen before is hidden
  EXPECT_EQ(f.out[0], 0b101u);
  EXPECT_FLOAT_EQ(f.share(0, 0), 1.0f);
  EXPECT_FLOAT_EQ(f.share(0, 1), 0.0f);
  EXPECT_FLOAT_EQ(f.share(0, 2), 14.0f / 15);
  f.ids = {200};
  f.step(0b0, {});
  EXPECT_EQ(f.out[0], 0u);
  f.ids = {100, 200};
  f.step(0b01, {});
  EXPECT_FLOAT_EQ(f.share(0, 0), 1.0f) << "one that was away is a new one";
}

TEST(TemporalVolume, ATargetThatIsNotSteeredForIsNoPartOfTheJointState) {
  Fixture f;
  for (int i = 0; i < 20; ++i) f.step(i % 2 == 0 ? 0b01 : 0b11, joint(10, 0.6));
  EXPECT_EQ(f.out[0], 0u);
  const std::vector<uint32_t> now(f.lattice.addresses().size(), 0b11);
  f.volume.filter(f.lattice.addresses(), now, 0b01, f.out);
  EXPECT_EQ(f.out[0], 0b11u) << "the other one as of now";
}

TEST(TemporalVolume, ANewSpacingStartsEveryCellAnew) {
  Fixture f;
  for (int i = 0; i < 20; ++i) f.step(0b00, {});
  const Bound wide = ball(glm::dvec3(0.0), 3.0);
  f.lattice.cover(wide, 125);
  f.step(wide, std::vector<uint32_t>(f.lattice.addresses().size(), 0b11), {});
  for (const uint32_t visible : f.out) EXPECT_EQ(visible, 0b11u);
}

TEST(TemporalVolume, APlaceTakesOverThePastOfTheLatticePointThatItComesNearestTo) {
  Lattice lattice;
  TemporalVolume volume;
  std::vector<uint32_t> out;
  const std::vector<uint64_t> ids{5};
  const Bound bound = ball(glm::dvec3(0.0), 1.0);
  const auto step = [&](const glm::dvec3& place, uint32_t seen) {
    lattice.cover(bound, 125);
    std::vector<uint32_t> visible;
    for (const glm::dvec3& p : lattice.positions_m()) visible.push_back(p.x > 0.1 ? 1u : 0u);
    volume.begin_step(lattice, 1, ids, {}, kDt);
    volume.push(lattice, visible);
    volume.push_place(0, lattice, place, seen);
    const std::vector<uint32_t> slots{volume.place_slot(0)}, now{seen};
    volume.filter(slots, now, 1, out);
  };
  const auto share = [&] {
    return visible_share(volume.history().records(volume.place_slot(0))[0], filter_steps({}, kDt).window).share();
  };
  for (int i = 0; i < 40; ++i) step({0.6, 0.0, 0.0}, i % 3 == 0 ? 0 : 1);
  EXPECT_NEAR(share(), 2.0 / 3, 1e-6) << "its own past while it stays";
  step({-0.6, 0.0, 0.0}, 1);
  EXPECT_NEAR(share(), 1.0 / 15, 1e-6) << "hidden there so far, seen now";
  EXPECT_EQ(out[0], 0u);
  step({0.6, 0.0, 0.0}, 0);
  EXPECT_EQ(out[0], 1u) << "the switch of that point comes along";
  step({50.0, 0.0, 0.0}, 1);
  EXPECT_FLOAT_EQ(share(), 1.0f) << "no lattice point, no past";
}

TEST(TemporalVolume, APlaceOfWhichTheWindowSaysNothingIsHiddenJointlyAndKeptPerTarget) {
  for (const bool jointly : {false, true}) {
    const FilterSettings settings = jointly ? joint(15, 0.6) : FilterSettings{};
    Fixture f;
    for (int i = 0; i < 20; ++i) f.step(0b11, settings);
    const std::vector<uint32_t> slot{f.lattice.addresses()[0]}, now{0};
    for (int away = 1; away <= 20; ++away) {
      f.volume.begin_step(f.lattice, 0, f.ids, settings, kDt);
      f.volume.filter(slot, now, 0b11, f.out);
      EXPECT_EQ(f.out[0], jointly && away >= 15 ? 0u : 0b11u) << away;
    }
  }
}

TEST(TemporalVolume, ACandidateWithNoSlotIsTakenAsItIsNow) {
  Fixture f;
  f.step(0b00, {});
  const std::vector<uint32_t> slots{TemporalVolume::kNoSlot}, now{0b10};
  f.volume.filter(slots, now, 0b11, f.out);
  EXPECT_EQ(f.out[0], 0b10u);
}

TEST(TemporalVolume, TheModeCanChangeBetweenSteps) {
  Fixture switched, steady;
  for (int i = 0; i < 200; ++i) {
    const uint32_t visible = i % 7 < 4 ? 0b11 : 0b01;
    const FilterSettings settings = i % 40 < 20 ? FilterSettings{} : joint(10, 0.6);
    switched.step(visible, settings);
    steady.step(visible, {});
    if (settings.mode == FilterMode::kPerTarget) {
      EXPECT_EQ(switched.out, steady.out);
    }
  }
}

TEST(TemporalVolume, ThirtyTwoTargets) {
  Fixture f;
  f.ids.clear();
  for (uint64_t id = 1; id <= 32; ++id) f.ids.push_back(id);
  for (int i = 0; i < 20; ++i) f.step(0x80000001u, {});
  EXPECT_EQ(f.out[0], 0x80000001u);
  f.step(0x80000001u, joint(20, 1.0));
  EXPECT_EQ(f.out[0], 0x80000001u);
}

TEST(Lattice, AnOwnersNumberIsNeverGivenTwice) {
  Lattice lattice;
  std::map<uint64_t, std::tuple<uint32_t, double, Place>> owners;
  for (int step = 0; step < 300; ++step) {
    lattice.cover(ball({0.1 * std::sin(0.1 * step) * step, 0, 0}, step % 50 < 45 ? 1.0 : 2.0), 125);
    for (size_t i = 0; i < lattice.addresses().size(); ++i) {
      const uint32_t address = lattice.addresses()[i];
      const std::tuple cell{address, lattice.spacing_m(), place_of(lattice, i)};
      ASSERT_NE(lattice.owner(address), 0u);
      ASSERT_EQ(owners.try_emplace(lattice.owner(address), cell).first->second, cell);
      ASSERT_EQ(lattice.address_near(lattice.positions_m()[i] + 0.3 * lattice.spacing_m()), address);
    }
  }
  EXPECT_FALSE(lattice.address_near({1000.0, 0.0, 0.0}).has_value());
}

}  // namespace
}  // namespace sightline
