#include "server/aggregate/filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "tests/support/plain_past.h"

namespace sightline {
namespace {

constexpr double kDt = 1.0 / 60;

PlainPast past(const char* steps) {
  PlainPast p;
  for (; *steps; ++steps) p.push_back(*steps == 'v' ? Seen::kVisible : *steps == '.' ? Seen::kHidden : Seen::kUnknown);
  return p;
}

uint32_t joint(const std::vector<PlainPast>& pasts, int n, double alpha) {
  const auto records = as_records(pasts);
  return joint_state(records, (1u << pasts.size()) - 1, n, alpha).visible_targets;
}

// ---- the joint filter ----

TEST(JointFilter, EqualsThePlainCountOnRandomPasts) {
  for (uint64_t seed = 0; seed < 3000; ++seed) {
    CounterRandom random(seed, 0, RandomPurpose::kTest);
    const size_t targets = 1 + random.next_below(seed % 10 == 0 ? 12 : 3);
    std::vector<PlainPast> pasts;
    for (size_t i = 0; i < targets; ++i)
      pasts.push_back(random_past(random, random.next_below(90), 1 + random.next_below(20), random.next_below(6)));
    const auto records = as_records(pasts);
    for (const double alpha : {0.0, 0.25, 1.0 / 3, 0.5, 0.6, 0.9, 1.0}) {
      const int n = 1 + static_cast<int>(random.next_below(64));
      const PlainState plain = plain_joint(pasts, n, alpha);
      const JointState state = joint_state(records, (1u << targets) - 1, n, alpha);
      ASSERT_EQ(state.known, plain.known) << seed;
      for (size_t i = 0; i < targets; ++i)
        ASSERT_EQ(state.visible_targets >> i & 1u, plain.visible[i] ? 1u : 0u)
            << "seed " << seed << " n " << n << " alpha " << alpha << " target " << i;
    }
  }
}

TEST(JointFilter, ThreeOfFiveSixOfTenAndEightOfFifteenAreEnoughAndOneLessIsNot) {
  for (const auto& [count, n] : {std::pair(3, 5), std::pair(6, 10), std::pair(8, 15)}) {
    PlainPast p(n, Seen::kHidden);
    std::fill_n(p.begin(), count, Seen::kVisible);
    const double alpha = static_cast<double>(count) / n;
    EXPECT_EQ(joint({p}, n, alpha), 1u) << n;
    p[0] = Seen::kHidden;
    EXPECT_EQ(joint({p}, n, alpha), 0u) << n;
  }
}

TEST(JointFilter, NoStateOftenEnoughIsNothingSeen) {
  EXPECT_EQ(joint({past("vvv..."), past("v.v.v.")}, 6, 0.6), 0u);
}

TEST(JointFilter, OfEquallyFrequentStatesTheOneThatOccurredLastIsKept) {
  EXPECT_EQ(joint({past("vv..")}, 4, 0.5), 0u);
  EXPECT_EQ(joint({past("..vv")}, 4, 0.5), 1u);
  EXPECT_EQ(joint({past("v..v"), past(".v.v")}, 4, 0.0), 3u);
}

TEST(JointFilter, AlphaZeroIsTheMostFrequentStateAndAlphaOneOnlyWhatNeverChanged) {
  EXPECT_EQ(joint({past("vv.v."), past(".....")}, 5, 0.0), 1u);
  EXPECT_EQ(joint({past("vvvvv"), past(".....")}, 5, 1.0), 1u);
  EXPECT_EQ(joint({past("vvvvv"), past("....v")}, 5, 1.0), 0u);
}

TEST(JointFilter, AWindowOfOneOrNoneIsTheNewestStateAlone) {
  for (const int n : {0, 1})
    for (const double alpha : {0.0, 0.6, 1.0}) {
      EXPECT_EQ(joint({past("....v"), past("vvvv.")}, n, alpha), 1u);
      EXPECT_EQ(joint({past("vvvv."), past("....v")}, n, alpha), 2u);
    }
}

TEST(JointFilter, UnknownStepsAreNeitherSeenNorHidden) {
  EXPECT_EQ(joint({past("?????v")}, 6, 1.0), 1u) << "a place that just came into the bound is what it is now";
  EXPECT_EQ(joint({past("v????v")}, 6, 1.0), 1u);
  EXPECT_EQ(joint({past(".????v")}, 6, 0.6), 0u);
}

TEST(JointFilter, NothingKnownIsNothingSeenAndSaysSo) {
  const auto records = as_records({past("vv????"), past("??????")});
  const JointState state = joint_state(records, 0b11, 4, 0.0);
  EXPECT_EQ(state.visible_targets, 0u);
  EXPECT_FALSE(state.known);
}

TEST(JointFilter, OnlyTheTargetsAskedForMakeUpTheState) {
  const auto records = as_records({past("vvvvv"), past("v.v.v"), past("?????")});
  EXPECT_EQ(joint_state(records, 0b011, 5, 0.7).visible_targets, 0u);
  EXPECT_EQ(joint_state(records, 0b001, 5, 0.7).visible_targets, 1u);
}

// ---- the per-target filter ----

// The same rules over lists of all steps.
class PlainSwitch {
 public:
  PlainSwitch(const FilterSettings& settings, const FilterSteps& steps) : settings_(settings), steps_(steps) {}

  bool see(Seen seen) {
    past_.push_back(seen);
    ++since_on_;
    if (seen == Seen::kUnknown) return visible_;
    if (!known_in_memory())
      since_on_ = 1000, visible_ = seen == Seen::kVisible;
    else if (visible_ && may_lose())
      visible_ = false;
    else if (!visible_ && seen == Seen::kVisible && share() >= settings_.visible_threshold - 1e-6)
      since_on_ = 0, visible_ = true;
    return visible_;
  }
  double share() const {
    double visible = 0, known = 0;
    for (int k = 0; k < steps_.window; ++k) {
      visible += steps_before(past_, k) == Seen::kVisible;
      known += steps_before(past_, k) != Seen::kUnknown;
    }
    return visible / known;
  }
  const PlainPast& past() const { return past_; }

 private:
  bool known_in_memory() const {
    for (int k = 1; k <= std::max({steps_.window, steps_.min_occlusion, steps_.hold}); ++k)
      if (k < kHistorySteps && steps_before(past_, k) != Seen::kUnknown) return true;
    return false;
  }
  int hidden_for() const {
    int hidden = 0;
    for (int k = 0; k < kHistorySteps && steps_before(past_, k) != Seen::kVisible; ++k)
      hidden += steps_before(past_, k) == Seen::kHidden;
    return hidden;
  }
  bool may_lose() const {
    return since_on_ >= steps_.hold && hidden_for() >= steps_.min_occlusion &&
           share() <= settings_.hidden_threshold + 1e-6;
  }

  FilterSettings settings_;
  FilterSteps steps_;
  PlainPast past_;
  bool visible_ = false;
  int since_on_ = 1000;
};

FilterSettings random_settings(CounterRandom& random) {
  FilterSettings s;
  s.window_s = random.next_in(0.001, 1.0);
  s.visible_threshold = random.next_unit();
  s.hidden_threshold = s.visible_threshold * random.next_unit();
  s.min_occlusion_s = random.next_in(0, 0.4);
  s.hold_s = random.next_in(0, 0.4);
  return s;
}

std::vector<bool> filtered(const PlainPast& steps, const FilterSettings& settings, double dt_s = kDt) {
  TargetSwitch state;
  VisibilityRecord record;
  std::vector<bool> out;
  for (size_t i = 0; i < steps.size(); ++i) {
    record.visible = record.visible << 1 | (steps[i] == Seen::kVisible);
    record.known = record.known << 1 | (steps[i] != Seen::kUnknown);
    update(state, record, i, filter_steps(settings, dt_s), settings);
    out.push_back(state.visible);
  }
  return out;
}

TEST(TargetFilter, EqualsThePlainRulesOnRandomPasts) {
  for (uint64_t seed = 0; seed < 600; ++seed) {
    CounterRandom random(seed, 1, RandomPurpose::kTest);
    const FilterSettings settings = seed % 3 == 0 ? FilterSettings{} : random_settings(random);
    ASSERT_TRUE(validate(settings).has_value());
    const double dt = seed % 2 == 0 ? kDt : random.next_in(0.002, 0.1);
    const PlainPast steps = random_past(random, 400, 1 + random.next_below(40), random.next_below(5));
    const std::vector<bool> out = filtered(steps, settings, dt);
    PlainSwitch plain(settings, filter_steps(settings, dt));
    for (size_t i = 0; i < steps.size(); ++i)
      ASSERT_EQ(out[i], plain.see(steps[i])) << "seed " << seed << " step " << i;
  }
}

TEST(TargetFilter, KeepsATargetThatWasSeenInEveryStepWhileAnotherFlickers) {
  // The joint filter classifies the candidate as N: V and P_A each make up half of the steps, and 0.5 < alpha.
  PlainPast always(60, Seen::kVisible), flickers;
  for (int i = 0; i < 60; ++i) flickers.push_back(i % 2 == 0 ? Seen::kVisible : Seen::kHidden);
  EXPECT_EQ(joint({always, flickers}, 10, 0.6), 0u);
  EXPECT_TRUE(filtered(always, {}).back());
}

int changes(const std::vector<bool>& states) {
  int count = 0;
  for (size_t i = 1; i < states.size(); ++i) count += states[i] != states[i - 1];
  return count;
}

TEST(TargetFilter, NeverChangesMoreOftenThanWhatItFilters) {
  for (uint64_t seed = 0; seed < 600; ++seed) {
    CounterRandom random(seed, 2, RandomPurpose::kTest);
    const FilterSettings settings = random_settings(random);
    const PlainPast steps = random_past(random, 400, 1 + random.next_below(20), random.next_below(5));
    std::vector<bool> raw;
    for (const Seen seen : steps)
      raw.push_back(seen == Seen::kUnknown ? !raw.empty() && raw.back() : seen == Seen::kVisible);
    EXPECT_LE(changes(filtered(steps, settings)), changes(raw)) << seed;
  }
}

TEST(TargetFilter, OverlooksOcclusionsShorterThanTheMinimum) {
  for (uint64_t seed = 0; seed < 300; ++seed) {
    CounterRandom random(seed, 3, RandomPurpose::kTest);
    const FilterSettings settings = seed == 0 ? FilterSettings{} : random_settings(random);
    const int least = filter_steps(settings, kDt).min_occlusion;
    PlainPast steps(1, Seen::kVisible);
    while (steps.size() < 400 && least > 1) {
      steps.insert(steps.end(), 1 + random.next_below(least - 1), Seen::kHidden);
      steps.insert(steps.end(), 1 + random.next_below(3), Seen::kVisible);
    }
    for (const bool seen : filtered(steps, settings)) ASSERT_TRUE(seen) << seed;
  }
}

TEST(TargetFilter, StaysOnForTheHoldOnceATargetIsSeenAgain) {
  for (uint64_t seed = 0; seed < 300; ++seed) {
    CounterRandom random(seed, 4, RandomPurpose::kTest);
    const FilterSettings settings = random_settings(random);
    const FilterSteps steps = filter_steps(settings, kDt);
    const std::vector<bool> out = filtered(random_past(random, 500, 1 + random.next_below(30), 0), settings);
    std::optional<size_t> turned_on;
    for (size_t i = 1; i < out.size(); ++i) {
      if (out[i] && !out[i - 1]) turned_on = i;
      if (!out[i] && out[i - 1] && turned_on) {
        EXPECT_GE(static_cast<int>(i - *turned_on), steps.hold) << seed;
      }
    }
  }
}

// The number of steps of occlusion after which the filter reports the target as hidden.
int reaction_steps(PlainPast before, const FilterSettings& settings, double dt_s) {
  const size_t begin = before.size();
  before.insert(before.end(), 200, Seen::kHidden);
  const std::vector<bool> out = filtered(before, settings, dt_s);
  size_t i = begin;
  while (i < out.size() && out[i]) ++i;
  return static_cast<int>(i - begin) + 1;
}

TEST(TargetFilter, NoticesALastingOcclusionInTimeWhateverCameBefore) {
  for (uint64_t seed = 0; seed < 2000; ++seed) {
    CounterRandom random(seed, 5, RandomPurpose::kTest);
    const FilterSettings settings = seed % 2 == 0 ? FilterSettings{} : random_settings(random);
    const FilterSteps steps = filter_steps(settings, kDt);
    const PlainPast before = random_past(random, random.next_below(150), 1 + random.next_below(30),
                                         random.next_below(5));
    const int reaction = reaction_steps(before, settings, kDt);
    const double bound = std::max(
        {(1 - settings.hidden_threshold) * steps.window + 1, 1.0 * steps.min_occlusion, 1.0 * steps.hold});
    ASSERT_LE(reaction, bound) << seed;
    if (seed % 2 == 0) {
      ASSERT_LE(reaction * kDt, 0.35) << seed;
    }
  }
}

TEST(TargetFilter, NoticesALastingOcclusionAfterALongClearViewBeforeItsHoldMatters) {
  const int reaction = reaction_steps(PlainPast(100, Seen::kVisible), {}, kDt);
  EXPECT_EQ(reaction, 9) << "0.15 s at 60 Hz: the minimum occlusion, and the share 6 / 15 of the window";
}

TEST(TargetFilter, NoticesALastingOcclusionInTimeAtAnyRate) {
  for (const double hz : {20.0, 24.0, 30.0, 50.0, 60.0, 90.0, 120.0, 144.0, 240.0})
    EXPECT_LE(reaction_steps(PlainPast(300, Seen::kVisible), {}, 1 / hz) / hz, 0.35) << hz;
}

TEST(TargetFilter, APlaceUnknownForLongIsWhatItIsNow) {
  PlainPast steps(100, Seen::kVisible);
  steps.insert(steps.end(), 20, Seen::kUnknown);
  steps.push_back(Seen::kHidden);
  EXPECT_FALSE(filtered(steps, {}).back());
  steps.insert(steps.end(), 20, Seen::kUnknown);
  steps.push_back(Seen::kVisible);
  EXPECT_TRUE(filtered(steps, {}).back());
}

TEST(TargetFilter, AShortAbsenceChangesNothing) {
  PlainPast steps(100, Seen::kVisible);
  steps.insert(steps.end(), 5, Seen::kUnknown);
  steps.push_back(Seen::kHidden);
  EXPECT_TRUE(filtered(steps, {}).back());
}

TEST(TargetFilter, TwiceInOneStepIsAsOnce) {
  CounterRandom random(9, 6, RandomPurpose::kTest);
  const PlainPast steps = random_past(random, 500, 12, 6);
  TargetSwitch once, twice;
  for (size_t i = 0; i < steps.size(); ++i) {
    const VisibilityRecord record = as_record(PlainPast(steps.begin(), steps.begin() + static_cast<long>(i) + 1));
    update(once, record, i, filter_steps({}, kDt), {});
    for (int k = 0; k < 2; ++k) update(twice, record, i, filter_steps({}, kDt), {});
    ASSERT_EQ(once.visible, twice.visible);
    ASSERT_EQ(once.held_until_step, twice.held_until_step);
  }
}

// ---- settings ----

TEST(FilterSteps, AreTheTimesInStepsOfThePresentLength) {
  const FilterSteps at60 = filter_steps({}, kDt);
  EXPECT_EQ(at60.window, 15);
  EXPECT_EQ(at60.min_occlusion, 6);
  EXPECT_EQ(at60.hold, 15);
  const FilterSteps slow = filter_steps({}, 10.0);
  EXPECT_EQ(slow.window, 1);
  EXPECT_EQ(slow.min_occlusion, 1);
  for (const double dt : {0.0, 1e-6}) {
    EXPECT_EQ(filter_steps({}, dt).window, 64);
    EXPECT_EQ(filter_steps({}, dt).hold, 64);
  }
}

}  // namespace
}  // namespace sightline
