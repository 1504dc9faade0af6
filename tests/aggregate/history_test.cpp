#include "server/aggregate/history.h"

#include <gtest/gtest.h>

#include "tests/support/plain_past.h"

namespace sightline {
namespace {

VisibilityHistory one_slot(int targets) {
  VisibilityHistory history;
  history.resize(1);
  history.remap(std::vector<int>(targets, -1));
  return history;
}

void pass(VisibilityHistory& history, int steps) {
  for (int i = 0; i < steps; ++i) history.begin_step();
}

// The reference for the history: a list for each slot and target, to which every step adds one entry.
class PlainHistory {
 public:
  explicit PlainHistory(size_t slots) : owners_(slots, 0), pasts_(slots) {}

  void remap(const std::vector<int>& old_of_new) {
    for (auto& slot : pasts_) {
      std::vector<PlainPast> now;
      for (const int old : old_of_new) now.push_back(old < 0 ? PlainPast{} : slot[old]);
      slot = now;
    }
  }
  void begin_step() {
    for (auto& slot : pasts_)
      for (PlainPast& past : slot) past.push_back(Seen::kUnknown);
  }
  void push(size_t slot, uint64_t owner, uint32_t visible, uint32_t known) {
    for (size_t i = 0; i < pasts_[slot].size(); ++i) {
      PlainPast& past = pasts_[slot][i];
      if (owner != owners_[slot]) past.clear();
      if (past.empty()) past.push_back(Seen::kUnknown);
      past.back() = !(known >> i & 1u) ? Seen::kUnknown : visible >> i & 1u ? Seen::kVisible : Seen::kHidden;
    }
    owners_[slot] = owner;
  }
  std::vector<VisibilityRecord> records(size_t slot) const { return as_records(pasts_[slot]); }

 private:
  std::vector<uint64_t> owners_;
  std::vector<std::vector<PlainPast>> pasts_;
};

std::vector<int> random_targets(CounterRandom& random, size_t before) {
  std::vector<int> old_of_new;
  for (size_t i = 0; i < before; ++i)
    if (random.next_below(4) != 0) old_of_new.push_back(static_cast<int>(i));
  for (size_t i = old_of_new.size(); i > 1; --i) std::swap(old_of_new[i - 1], old_of_new[random.next_below(i)]);
  while (old_of_new.size() < kHistorySteps / 2 && random.next_below(3) != 0) old_of_new.push_back(-1);
  return old_of_new;
}

TEST(VisibilityHistory, HoldsWhatListsHoldWhateverIsPushedLeftOutHandedOverAndRemapped) {
  constexpr size_t kSlots = 6;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    CounterRandom random(seed, 0, RandomPurpose::kTest);
    VisibilityHistory history;
    PlainHistory plain(kSlots);
    history.resize(kSlots);
    std::vector<uint64_t> owner(kSlots, 1);
    for (int step = 0; step < 600; ++step) {
      if (random.next_below(150) == 0 || step == 0) {
        const auto old_of_new = random_targets(random, history.target_count());
        history.remap(old_of_new);
        plain.remap(old_of_new);
      }
      history.begin_step();
      plain.begin_step();
      for (uint32_t slot = 0; slot < kSlots; ++slot) {
        if (random.next_below(80) == 0) ++owner[slot];
        // Slot 0 is pushed in every step; the higher the slot, the longer its absences.
        if (random.next_below(1 + slot * slot * 4) > 3) continue;
        const uint32_t visible = random.next_u32(), known = random.next_u32() | random.next_u32();
        history.push(slot, owner[slot], visible, known);
        plain.push(slot, owner[slot], visible, known);
      }
      const uint32_t asked = random.next_below(kSlots);
      const auto records = history.records(asked);
      ASSERT_EQ(std::vector<VisibilityRecord>(records.begin(), records.end()), plain.records(asked))
          << "seed " << seed << " step " << step << " slot " << asked;
    }
  }
}

TEST(VisibilityHistory, StepsWithoutAPushAreUnknownAndNotHidden) {
  VisibilityHistory history = one_slot(1);
  history.push(0, 1, 1);
  pass(history, 3);
  history.push(0, 1, 0);
  EXPECT_EQ(history.records(0)[0], (VisibilityRecord{0b1000, 0b1001}));
}

TEST(VisibilityHistory, SixtyThreeStepsOfAbsenceAreRememberedAndSixtyFourAreNot) {
  for (const int missed : {63, 64, 65, 1000}) {
    VisibilityHistory history = one_slot(1);
    for (int i = 0; i < 3; ++i) pass(history, 1), history.push(0, 1, 1);
    pass(history, missed);
    history.push(0, 1, 1);
    EXPECT_EQ(history.records(0)[0].known, missed == 63 ? uint64_t{1} << 63 | 1 : 1) << missed;
  }
}

TEST(VisibilityHistory, ASecondPushInOneStepReplacesTheFirst) {
  VisibilityHistory history = one_slot(2);
  history.push(0, 1, 0b01);
  history.push(0, 1, 0b10);
  EXPECT_EQ(history.records(0)[0], (VisibilityRecord{0, 1}));
  EXPECT_EQ(history.records(0)[1], (VisibilityRecord{1, 1}));
}

TEST(VisibilityHistory, ASlotOfNobodyHasNoPast) {
  VisibilityHistory history = one_slot(1);
  for (int i = 0; i < 5; ++i) pass(history, 1), history.push(0, 0, 1);
  EXPECT_EQ(history.records(0)[0].known, 1u);
}

TEST(VisibilityHistory, ForgetsEverySlot) {
  VisibilityHistory history;
  history.resize(2);
  history.remap(std::vector<int>{-1});
  history.begin_step();
  history.push(1, 7, 1u);
  history.forget();
  EXPECT_EQ(history.owner(1), 0u);
  history.begin_step();
  history.push(1, 7, 0u);
  EXPECT_EQ(history.records(1)[0], (VisibilityRecord{0, 1})) << "the same owner has no past";
}

TEST(VisibilityHistory, ACopyGoesOnFromTheSamePast) {
  VisibilityHistory history;
  history.resize(2);
  history.remap(std::vector<int>{-1, -1});
  for (int i = 0; i < 5; ++i) pass(history, 1), history.push(0, 7, i % 2 == 0 ? 0b11 : 0b01);
  pass(history, 2);
  history.copy(0, 1);
  EXPECT_EQ(history.owner(1), 7u);
  history.push(0, 7, 0b00);
  history.push(1, 7, 0b11);
  for (const int target : {0, 1}) {
    EXPECT_EQ(history.records(0)[target].known, history.records(1)[target].known);
    EXPECT_EQ(history.records(0)[target].visible | 1u, history.records(1)[target].visible);
  }
}

TEST(VisibilityHistory, ReusesItsMemory) {
  VisibilityHistory history;
  history.resize(100);
  history.remap(std::vector<int>{-1, -1});
  const VisibilityRecord* first = history.records(0).data();
  for (int step = 0; step < 200; ++step) {
    history.resize(100);
    history.begin_step();
    for (uint32_t slot = 0; slot < 100; ++slot) history.push(slot, 1, slot);
  }
  EXPECT_EQ(history.records(0).data(), first);
}

}  // namespace
}  // namespace sightline
