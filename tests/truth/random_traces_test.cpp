// The figures of a run against plain reimplementations on random traces.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "client/truth/metrics.h"
#include "client/truth/reports.h"
#include "scenes/hall.h"
#include "server/scene/gltf.h"

namespace sightline {
namespace {

using Random = std::mt19937_64;

double unit(Random& random) {
  return std::uniform_real_distribution<double>(0.0, 1.0)(random);
}

// Pictures at steps of 0.1 s whose share is often 0, often 1 and sometimes between.
std::vector<SightSample> random_sights(Random& random, size_t count) {
  std::vector<SightSample> samples;
  double share = 1.0;
  for (size_t i = 0; i < count; ++i) {
    if (unit(random) < 0.3) {
      const double draw = unit(random);
      share = draw < 0.4 ? 0.0 : draw < 0.7 ? 1.0 : unit(random);
    }
    samples.push_back({0.1 * static_cast<double>(i), share});
  }
  return samples;
}

// Episodes by direct indexing: each index looks up its neighbours, and no state is carried along.
struct PlainEpisodes {
  std::vector<double> lengths, reacquired;
  size_t open = 0;

  void add(const std::vector<SightSample>& s) {
    for (size_t i = 0; i < s.size(); ++i) {
      const bool starts = s[i].visible_share == 0.0 && (i == 0 || s[i - 1].visible_share > 0.0);
      if (!starts) continue;
      double until = s.back().time_s, clear = s.back().time_s;
      bool found = false;
      for (size_t j = s.size(); j-- > i;) {
        if (s[j].visible_share > 0.0) until = s[j].time_s;
        if (s[j].visible_share >= 0.95) clear = s[j].time_s, found = true;
      }
      lengths.push_back(until - s[i].time_s);
      reacquired.push_back(clear - s[i].time_s);
      open += !found;
    }
  }
};

TEST(Episodes, EqualAPlainCountOnRandomTraces) {
  Random random(1);
  for (int round = 0; round < 200; ++round) {
    const std::vector<std::vector<SightSample>> targets{random_sights(random, 1 + round), random_sights(random, 60)};
    PlainEpisodes plain;
    for (const auto& samples : targets) plain.add(samples);
    const EpisodeMetrics metrics = episodes_of(targets);
    ASSERT_EQ(metrics.count, plain.lengths.size());
    ASSERT_EQ(metrics.never_reacquired, plain.open);
    if (plain.lengths.empty()) continue;
    std::sort(plain.lengths.begin(), plain.lengths.end());
    const auto rank = static_cast<size_t>(std::ceil(0.95 * static_cast<double>(plain.lengths.size())));
    EXPECT_DOUBLE_EQ(metrics.p95_length_s, plain.lengths[rank - 1]);
    double sum = 0;
    for (const double t : plain.reacquired) sum += t;
    EXPECT_NEAR(metrics.mean_reacquire_s, sum / static_cast<double>(plain.reacquired.size()), 1e-9);
  }
}

TEST(Episodes, NoneWithoutSamplesOrLosses) {
  EXPECT_EQ(episodes_of({}).count, 0u);
  const std::vector<std::vector<SightSample>> seen{{}, {{0.0, 1.0}, {0.1, 0.01}}};
  EXPECT_EQ(episodes_of(seen).count, 0u);
}

struct Trace {
  std::vector<CameraFrame> frames;
  std::vector<FrameTruth> truths;
};

// A camera that mostly walks, sometimes leaps or spins, and sometimes declares it; centres that come and go.
Trace random_trace(Random& random, size_t count) {
  Trace trace;
  glm::dvec3 at(0.0);
  double yaw = 0;
  for (size_t i = 0; i < count; ++i) {
    CameraFrame frame;
    frame.time_s = static_cast<double>(i) / 60;
    frame.jump = unit(random) < 0.1;
    const double reach = unit(random) < 0.1 ? 2.0 : 0.3;
    at += reach * glm::dvec3(unit(random) - 0.5, unit(random) - 0.5, unit(random) - 0.5);
    yaw += (unit(random) < 0.1 ? 0.4 : 0.04) * (unit(random) - 0.5);
    frame.camera = {at, glm::angleAxis(yaw, glm::dvec3(0, 1, 0))};
    trace.frames.push_back(frame);
    FrameTruth truth;
    for (int k = 0; k < 3; ++k) {
      truth.centers.emplace_back();
      if (unit(random) < 0.8) truth.centers.back() = glm::dvec2(unit(random) - 0.5, unit(random) - 0.5);
    }
    trace.truths.push_back(truth);
  }
  return trace;
}

Scenario any_scenario(GeometryStore& store) {
  return *Scenario::from_asset(*read_gltf(scenes::make_hall({.duration_s = 2.0}), nullptr, store));
}

TEST(Travel, BothTravelsEqualAPlainSumOnRandomTraces) {
  GeometryStore store;
  const Scenario scenario = any_scenario(store);
  Random random(2);
  for (int round = 0; round < 20; ++round) {
    const Trace trace = random_trace(random, 200);
    const RunMetrics metrics = summarize(scenario, trace.frames, trace.truths, CameraLimits{});
    double d_c = 0, d_s = 0;
    for (size_t i = 1; i < 200; ++i) {
      const Pose &a = trace.frames[i - 1].camera, &b = trace.frames[i].camera;
      if (trace.frames[i].jump) continue;
      const double moved = std::sqrt(std::pow(b.position_m.x - a.position_m.x, 2) +
                                     std::pow(b.position_m.y - a.position_m.y, 2) +
                                     std::pow(b.position_m.z - a.position_m.z, 2));
      d_c += moved;
      for (size_t k = 0; k < 3; ++k) {
        const auto &p = trace.truths[i - 1].centers[k], &q = trace.truths[i].centers[k];
        if (p.has_value() && q.has_value()) d_s += std::hypot(p->x - q->x, p->y - q->y);
      }
    }
    EXPECT_NEAR(metrics.d_c_m, d_c, 1e-9);
    EXPECT_NEAR(metrics.d_s_heights, d_s, 1e-9);
  }
}

TEST(Motion, JerkIsTheThirdDifferenceOfThePlaces) {
  Random random(3);
  std::vector<CameraFrame> frames = random_trace(random, 60).frames;
  for (CameraFrame& frame : frames) frame.jump = false;
  const auto samples = motion_of(frames);
  const double dt = 1.0 / 60;
  double squares = 0;
  for (size_t i = 3; i < frames.size(); ++i) {
    const auto p = [&](size_t back) { return frames[i - back].camera.position_m; };
    const double jerk = glm::length(p(0) - 3.0 * p(1) + 3.0 * p(2) - p(3)) / (dt * dt * dt);
    ASSERT_TRUE(samples[i].has_jerk);
    EXPECT_NEAR(samples[i].jerk_mps3, jerk, 1e-6 * jerk);
    squares += jerk * jerk;
  }
  for (size_t i = 1; i < 3; ++i) squares += samples[i].jerk_mps3 * samples[i].jerk_mps3;
  GeometryStore store;
  const RunMetrics metrics = summarize(any_scenario(store), frames, std::vector<FrameTruth>(frames.size()),
                                       CameraLimits{});
  EXPECT_NEAR(metrics.rms_jerk_mps3, std::sqrt(squares / 59), 1e-6 * metrics.rms_jerk_mps3);
}

TEST(Motion, AJumpLeavesNoJerkForThreeFrames) {
  Random random(4);
  std::vector<CameraFrame> frames = random_trace(random, 12).frames;
  for (CameraFrame& frame : frames) frame.jump = false;
  frames[6].jump = true;
  const auto samples = motion_of(frames);
  for (size_t i = 1; i < 12; ++i) EXPECT_EQ(samples[i].has_jerk, i < 6 || i > 8) << i;
}

TEST(Reports, EqualAPlainCountOnRandomShares) {
  Random random(5);
  std::vector<FrameTruth> truths;
  std::vector<std::vector<ReportedShare>> reports;
  struct Sums {
    double error = 0, false_visible = 0, false_occluded = 0;
  };
  Sums step = {}, filtered = {};
  double pairs = 0, hidden = 0;
  const auto add = [](Sums& sums, double share, double true_share) {
    sums.error += std::abs(share - true_share);
    sums.false_visible += true_share < 0.5 && share >= 0.5;
    sums.false_occluded += true_share >= 0.5 && share < 0.5;
  };
  for (int i = 0; i < 500; ++i) {
    FrameTruth& truth = truths.emplace_back();
    std::vector<ReportedShare>& said = reports.emplace_back();
    if (i % 3 == 0) truth.picture.emplace();
    for (uint64_t id = 1; id <= 2; ++id) {
      const auto alone = static_cast<uint32_t>(unit(random) < 0.2 ? 0 : 100);
      const auto visible = static_cast<uint32_t>(alone * unit(random));
      const double share = unit(random), filtered_share = unit(random) * unit(random);
      said.insert(said.begin(), {id, share, filtered_share});  // not in the truth's order
      if (!truth.picture) continue;
      truth.picture->targets.push_back({id, alone, visible, true});
      if (alone == 0) continue;
      const double true_share = visible / 100.0;
      pairs += 1, hidden += true_share < 0.5;
      add(step, share, true_share);
      add(filtered, filtered_share, true_share);
    }
  }
  const ReportMetrics metrics = judge_reports(truths, reports);
  EXPECT_EQ(static_cast<double>(metrics.pairs), pairs);
  EXPECT_EQ(static_cast<double>(metrics.hidden_pairs), hidden);
  for (const auto& [got, sums] : {std::pair(metrics.visible, step), std::pair(metrics.filtered, filtered)}) {
    EXPECT_NEAR(got.mean_absolute_error, sums.error / pairs, 1e-9);
    EXPECT_NEAR(got.false_visible, sums.false_visible / hidden, 1e-9);
    EXPECT_NEAR(got.false_occluded, sums.false_occluded / (pairs - hidden), 1e-9);
  }
}

}  // namespace
}  // namespace sightline
