#include "server/aggregate/share_window.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/random.h"

namespace sightline {
namespace {

// The definition, literally: all samples that were ever added, in a list for each id.
class PlainWindow {
 public:
  void begin_step(const std::vector<uint64_t>& ids, double dt_s) {
    now_s_ += dt_s;
    std::erase_if(by_id_, [&](const auto& entry) { return std::ranges::count(ids, entry.first) == 0; });
    for (const uint64_t id : ids) by_id_[id];
  }
  void add(uint64_t id, uint32_t seen, uint32_t points) {
    std::vector<Step>& steps = by_id_[id];
    steps.push_back({now_s_, seen, points});
    if (steps.size() > kShareSteps) steps.erase(steps.begin());
    std::erase_if(steps, [&](const Step& step) { return now_s_ - step.at_s >= kShareWindowS; });
    if (steps.size() > 2 && differ(steps)) steps.erase(steps.begin(), steps.end() - 2), ++changes;
  }
  std::optional<double> share(uint64_t id) const {
    const std::vector<Step>& steps = by_id_.at(id);
    double seen = 0, points = 0;
    for (const Step& step : steps) {
      const double weight = 1 - (now_s_ - step.at_s) / kShareWindowS;
      seen += weight * step.seen, points += weight * step.points;
    }
    if (points == 0) return std::nullopt;
    return seen / points;
  }
  void forget() { by_id_.clear(); }

  int changes = 0;

 private:
  struct Step {
    double at_s;
    uint32_t seen, points;
  };
  // Compares the newest two samples with the rest.
  static bool differ(const std::vector<Step>& steps) {
    double s1 = 0, n1 = 0, s2 = 0, n2 = 0;
    for (size_t i = 0; i < steps.size(); ++i)
      if (i + 2 < steps.size())
        s1 += steps[i].seen, n1 += steps[i].points;
      else
        s2 += steps[i].seen, n2 += steps[i].points;
    if (n1 == 0 || n2 == 0) return false;
    const double p = (s1 + s2 + 1) / (n1 + n2 + 2);
    return std::abs(s1 / n1 - s2 / n2) > 2 * std::sqrt(p * (1 - p) / n1 + p * (1 - p) / n2);
  }
  double now_s_ = 0;
  std::map<uint64_t, std::vector<Step>> by_id_;
};

TEST(ShareWindow, EqualsAPlainListWhenTargetsComeAndGo) {
  CounterRandom random(51, 0, RandomPurpose::kTest);
  ShareWindow window;
  PlainWindow plain;
  std::vector<uint64_t> ids = {1, 2, 3};
  int known = 0, unknown = 0;
  for (int step = 0; step < 5000; ++step) {
    if (random.next_below(10) == 0) {
      ids.clear();
      for (uint64_t id = 1; id <= 6; ++id)
        if (random.next_below(2) == 0)
          ids.insert(ids.begin() + random.next_below(static_cast<uint32_t>(ids.size()) + 1), id);
    }
    if (random.next_below(200) == 0) window.forget(), plain.forget();
    // The window spans from many short steps down to less than one long step.
    const double dt_s = random.next_below(20) == 0 ? 0.3 : random.next_in(0.0, step % 1000 < 500 ? 0.005 : 0.03);
    window.begin_step(ids, dt_s);
    plain.begin_step(ids, dt_s);
    for (size_t i = 0; i < ids.size(); ++i) {
      const uint32_t points = random.next_below(9);
      const uint32_t seen = step % 40 < 20 ? points - random.next_below(points / 4 + 1) : random.next_below(points + 1);
      window.add(i, seen, points);
      plain.add(ids[i], seen, points);
    }
    for (size_t i = 0; i < ids.size(); ++i) {
      const auto got = window.share(i), want = plain.share(ids[i]);
      ASSERT_EQ(got.has_value(), want.has_value());
      if (want) {
        ASSERT_NEAR(*got, *want, 1e-9);
      }
      ++(want ? known : unknown);
    }
  }
  EXPECT_GT(known, 5000);
  EXPECT_GT(unknown, 50);
  EXPECT_GT(plain.changes, 100);
}

void step(ShareWindow& window, double dt_s, uint32_t seen, uint32_t points) {
  window.begin_step(std::vector<uint64_t>{7}, dt_s);
  window.add(0, seen, points);
}

TEST(ShareWindow, IsTheNewestStepAloneAfterForgettingOrAPauseOfAWindow) {
  ShareWindow window;
  for (int i = 0; i < 10; ++i) step(window, 0.01, 0, 8);
  EXPECT_EQ(window.share(0), 0.0);
  step(window, kShareWindowS, 6, 8);
  EXPECT_EQ(window.share(0), 0.75);
  for (int i = 0; i < 10; ++i) step(window, 0.01, 0, 8);
  window.forget();
  step(window, 0.01, 5, 8);
  EXPECT_EQ(window.share(0), 0.625);
}

// Two steps in a row that differ from all before are not chance.
TEST(ShareWindow, FollowsACleanChangeInTwoSteps) {
  ShareWindow window;
  for (int i = 0; i < 30; ++i) step(window, 1.0 / 60, 8, 8);
  step(window, 1.0 / 60, 0, 8);
  EXPECT_NEAR(*window.share(0), 0.5, 0.05) << "of the newest two, one";
  step(window, 1.0 / 60, 0, 8);
  EXPECT_EQ(window.share(0), 0.0);
}

// A difference of one point in eight is within chance, so the old steps count until they leave the window.
TEST(ShareWindow, FollowsASmallChangeWithinTheWindow) {
  ShareWindow window;
  for (int i = 0; i < 30; ++i) step(window, 1.0 / 60, 5, 8);
  double before = 5.0 / 8;
  int steps = 0;
  for (; *window.share(0) > 0.5; ++steps) {
    step(window, 1.0 / 60, 4, 8);
    EXPECT_LT(*window.share(0), before);
    before = *window.share(0);
  }
  EXPECT_EQ(steps, 8);
}

// Half of the points are seen, at random: the noise of the mean is well below the noise of one step.
TEST(ShareWindow, HasLessNoiseThanAStep) {
  CounterRandom random(52, 0, RandomPurpose::kTest);
  ShareWindow window;
  double of_step = 0, of_window = 0;
  for (int i = 0; i < 20000; ++i) {
    uint32_t seen = 0;
    for (int point = 0; point < 8; ++point) seen += random.next_below(2);
    step(window, 1.0 / 60, seen, 8);
    of_step += std::abs(seen / 8.0 - 0.5), of_window += std::abs(*window.share(0) - 0.5);
  }
  EXPECT_LT(of_window, 0.6 * of_step);
}

TEST(ShareWindow, SaysNothingWhileNoPointCounts) {
  ShareWindow window;
  step(window, 0.01, 0, 0);
  EXPECT_FALSE(window.share(0));
  step(window, 0.01, 1, 1);
  EXPECT_EQ(window.share(0), 1.0);
}

}  // namespace
}  // namespace sightline
