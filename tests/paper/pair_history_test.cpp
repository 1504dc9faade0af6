#include "server/paper/pair_history.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <map>
#include <optional>

#include "server/base/random.h"
#include "tests/aggregate/random_ball.h"

namespace sightline {
namespace {

// What one step took, kept whole.
struct Past {
  bool pair = false;
  PairChain chain;
  std::vector<DepthMap> maps;
  std::vector<uint64_t> ids;
  double bias = 0;
};

// Whether a target was seen from a point in an earlier step: the plain rule, in the basis of the maps themselves.
// Nothing if the point is outside what the volumes of that step show.
std::optional<std::vector<bool>> seen_then(const Past& past, const glm::dvec3& point) {
  if (!past.pair) return std::nullopt;
  for (const ChainLink& link : past.chain.links) {
    const auto views = pair_views(link.volume, past.maps[0].view.jitter);
    for (const MapView& view : views) {
      const MapPoint at = project(view, point);
      if (!at.in_window || at.depth_m > link.volume.far_m) return std::nullopt;
    }
  }
  std::vector<bool> seen;
  for (const DepthMap& map : past.maps) {
    const MapPoint at = project(map.view, point);
    const int x = nearest_ray(at.x, map.view.jitter.x, map.view.width),
              y = nearest_ray(at.y, map.view.jitter.y, map.view.height);
    seen.push_back(at.depth_m <= map.depth_at(x, y) * (1 + past.bias));
  }
  return seen;
}

// The paper's filter as printed, over states that are sets of ids. The newest step is what is seen now.
std::vector<bool> plain_filter(const std::deque<Past>& pasts, const glm::dvec3& point, uint32_t now,
                               const std::vector<uint64_t>& ids, uint32_t steered, int n, double alpha) {
  struct Count {
    int times = 0, newest = 0;
  };
  std::map<std::vector<bool>, Count> counts;
  int known = 0;
  for (int k = 0; k < std::min<int>(n, static_cast<int>(pasts.size())); ++k) {
    std::vector<bool> state;
    if (k == 0) {
      for (size_t i = 0; i < ids.size(); ++i)
        if (steered >> i & 1u) state.push_back(now >> i & 1u);
    } else {
      const auto seen = seen_then(pasts[k], point);
      if (!seen) continue;
      bool all = true;
      for (size_t i = 0; i < ids.size(); ++i) {
        if (!(steered >> i & 1u)) continue;
        const auto at = std::find(pasts[k].ids.begin(), pasts[k].ids.end(), ids[i]);
        all &= at != pasts[k].ids.end();
        if (at != pasts[k].ids.end()) state.push_back((*seen)[static_cast<size_t>(at - pasts[k].ids.begin())]);
      }
      if (!all) continue;
    }
    ++known;
    Count& count = counts[state];
    if (count.times++ == 0) count.newest = k;
  }
  const std::vector<bool>* best = nullptr;
  Count of_best;
  for (const auto& [state, count] : counts)
    if (count.times >= alpha * known - 1e-12 &&
        (!best || count.times > of_best.times || (count.times == of_best.times && count.newest < of_best.newest)))
      best = &state, of_best = count;
  std::vector<bool> filtered;
  for (size_t i = 0, k = 0; i < ids.size(); ++i) {
    const bool is_steered = steered >> i & 1u;
    filtered.push_back(is_steered ? best && (*best)[k] : now >> i & 1u);
    k += is_steered;
  }
  return filtered;
}

struct Walk {
  CounterRandom random;
  std::vector<glm::dvec3> targets;
  std::vector<uint64_t> ids;
  glm::dvec3 camera{0, 0, 6};
  uint64_t next_id = 10;

  Walk(uint64_t seed, size_t count) : random(seed, 0, RandomPurpose::kTest) {
    for (size_t i = 0; i < count; ++i) targets.push_back(random_vector(random, 2)), ids.push_back(next_id++);
  }
  void go_on() {
    camera += random_vector(random, 0.2);
    for (glm::dvec3& target : targets) target += random_vector(random, 0.1);
    if (random.next_unit() < 0.05) {  // another target, or the list turned round
      if (random.next_unit() < 0.5)
        ids.back() = next_id++, targets.back() = random_vector(random, 2);
      else
        std::reverse(ids.begin(), ids.end()), std::reverse(targets.begin(), targets.end());
    }
  }
  // Depths about as far as the ball, and often nothing at all.
  Past look() {
    Past past;
    const Bound bound = ball(camera, 1.0);
    const glm::dvec2 jitter = random.next_unit() < 0.5 ? glm::dvec2(0.5)
                                                       : glm::dvec2(random.next_unit(), random.next_unit());
    past.ids = ids;
    past.bias = 0.001;
    past.pair = random.next_unit() < 0.9 && make_pair_chain(targets, bound, 7, jitter, past.chain) == PairGap::kNone;
    if (!past.pair) return past;
    for (uint32_t i = 0; i < targets.size(); ++i) {
      DepthMap map{chain_view(past.chain, i, jitter), std::vector<float>(49), std::vector<uint32_t>(49, 0)};
      const double far = glm::distance(targets[i], camera);
      for (float& distance : map.distance_m)
        distance = random.next_unit() < 0.4 ? std::numeric_limits<float>::infinity()
                                            : static_cast<float>(random.next_in(0.7 * far, 1.4 * far));
      past.maps.push_back(std::move(map));
    }
    return past;
  }
};

class PairHistoryOf : public testing::TestWithParam<int> {};

TEST_P(PairHistoryOf, FiltersAsAPlainOneThatKeepsAllVolumes) {
  const auto count = static_cast<size_t>(GetParam());
  Walk walk(70 + count, count);
  PairHistory history;
  std::deque<Past> pasts;  // the newest first
  size_t changed = 0, compared = 0, out_of_bounds = 0;
  for (int step = 0; step < 1000; ++step) {
    walk.go_on();
    FilterSettings settings;
    settings.mode = FilterMode::kJoint;
    settings.n = step < 500 ? 10 : 1 + static_cast<int>(walk.random.next_below(15));
    settings.alpha = walk.random.next_in(0, 1);
    pasts.push_front(walk.look());
    const Past& now = pasts.front();
    if (!now.pair) {
      history.push_none(settings.n);
      if (pasts.size() > static_cast<size_t>(settings.n)) pasts.resize(static_cast<size_t>(settings.n));
      continue;
    }
    history.push(now.chain, now.maps, now.ids, now.bias, settings.n);
    if (pasts.size() > static_cast<size_t>(settings.n)) pasts.resize(static_cast<size_t>(settings.n));
    CandidateSet candidates;
    std::vector<glm::ivec3> texels;
    compose_chain(now.chain, now.maps, ball(walk.camera, 1.0), now.bias, candidates, texels);
    const auto places = candidates.position_m.view().singles_m();
    const auto steered = static_cast<uint32_t>(walk.random.next_unit() < 0.8 ? (1u << count) - 1 : 1u);
    std::vector<uint32_t> filtered;
    history.filter(places, candidates.visible_targets, walk.ids, steered, settings, filtered);
    ASSERT_EQ(filtered.size(), places.size());
    for (size_t i = 0; i < places.size(); ++i) {
      const auto expected = plain_filter(pasts, places[i], candidates.visible_targets[i], walk.ids, steered, settings.n,
                                         settings.alpha);
      for (size_t t = 0; t < count; ++t)
        ASSERT_EQ((filtered[i] >> t & 1u) != 0, expected[t])
            << "step " << step << " candidate " << i << " target " << t;
      changed += filtered[i] != candidates.visible_targets[i];
      ++compared;
      for (size_t k = 1; k < pasts.size(); ++k) out_of_bounds += pasts[k].pair && !seen_then(pasts[k], places[i]);
    }
  }
  EXPECT_GT(compared, 10'000u);
  EXPECT_GT(changed, compared / 20);
  EXPECT_GT(out_of_bounds, 1'000u);
}
INSTANTIATE_TEST_SUITE_P(Targets, PairHistoryOf, testing::Values(2, 3));

TEST(PairHistory, ForgetsWhenItIsCleared) {
  Walk walk(80, 2);
  PairHistory history;
  Past past;
  do past = walk.look();
  while (!past.pair);
  FilterSettings settings;
  settings.mode = FilterMode::kJoint;
  settings.n = 10, settings.alpha = 1.0;
  const std::vector<glm::dvec3> at{walk.camera};
  std::vector<uint32_t> filtered;
  const auto sees_all_now = [&] {
    history.filter(at, std::vector<uint32_t>{3u}, walk.ids, 3u, settings, filtered);
    return filtered.front() == 3u;
  };
  for (DepthMap& map : past.maps) std::fill(map.distance_m.begin(), map.distance_m.end(), 0.1f);
  history.push(past.chain, past.maps, past.ids, past.bias, settings.n);
  history.push(past.chain, past.maps, past.ids, past.bias, settings.n);
  EXPECT_FALSE(sees_all_now()) << "it was hidden a step ago";
  history.clear();
  history.push(past.chain, past.maps, past.ids, past.bias, settings.n);
  EXPECT_TRUE(sees_all_now());
}

}  // namespace
}  // namespace sightline
