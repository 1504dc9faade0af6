#include "server/sample/egl_measure.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/random.h"
#include "server/sample/map_taker.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

constexpr int kFrames = 7;  // after one that warms up
constexpr double kBudgetMs = 250.0;
// After its first frames a variant this many times as slow as the fastest is dropped.
constexpr double kHopeless = 3.0;
// Times this near cannot be told apart: the simpler way is taken.
constexpr double kAsFast = 1.25;
constexpr uint64_t kShapes = 16;  // of about a thousand triangles

constexpr double ms(int64_t ns) {
  return 1e-6 * static_cast<double>(ns);
}

// Balls about a square, looked at from its middle.
class MeasuredScene {
 public:
  MeasuredScene() {
    CounterRandom random(1, 0, RandomPurpose::kSceneGeneration);
    const auto ball = build_geometry(tessellate(SphereShape{1.0f}).value()).value();
    SceneDelta delta;
    for (uint64_t id = 1; id <= kShapes; ++id) {
      const double bearing_rad = random.next_in(0, 6.283), away_m = random.next_in(3, 30);
      delta.add.push_back({.id = id, .geometry = ball,
                           .pose = {{away_m * std::cos(bearing_rad), 0.0, away_m * std::sin(bearing_rad)}},
                           .attributes = {}});
    }
    (void)mirror_.apply(delta, {});
    table_.take_in(mirror_, 0.0);
    for (size_t i = 0; i < kMeasuredMaps * kMeasuredSessions; ++i) {
      MapView view;
      view.eye_m = {random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1)};
      const glm::dvec3 forward(random.next_in(-1, 1), random.next_in(-0.2, 0.2), random.next_in(-1, 1));
      view.world_from_view = glm::mat3_cast(look_rotation(forward, {0, 1, 0}, {1, 0, 0}));
      view.left = view.bottom = -0.3;
      view.right = view.top = 0.3;
      requests_.push_back({.view = view});
    }
    maps_.resize(requests_.size());
  }

  Status take(MapRenderer& renderer, const EglVariant& variant, size_t map_count) {
    const MapJob job{&table_, &mirror_, std::span(requests_).first(map_count), std::span(maps_).first(map_count)};
    taker_.prepare({&job, 1}, variant);
    return taker_.take(renderer);
  }

 private:
  SceneMirror mirror_;
  OccluderTable table_;
  std::vector<MapRequest> requests_;
  std::vector<DepthMap> maps_;
  MapTaker taker_;
};

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The frames of one variant.
struct Samples {
  EglVariant variant;
  std::vector<double> alone_ms, round_ms;
  bool dropped = false;

  EglTiming timing() {
    return {variant, median(alone_ms), median(round_ms)};
  }
};

class Measurement {
 public:
  Measurement(MapRenderer& renderer, const std::function<int64_t()>& clock_ns)
      : renderer_(renderer), clock_ns_(clock_ns), begin_ns_(clock_ns()) {}

  Status frame(Samples& samples) {
    // What another variant left in caches and allocators is not this one's cost.
    if (Status done = scene_.take(renderer_, samples.variant, kMeasuredMaps); !done) return done;
    if (Status done = take(samples.variant, kMeasuredMaps, samples.alone_ms); !done) return done;
    return take(samples.variant, kMeasuredMaps * kMeasuredSessions, samples.round_ms);
  }
  bool out_of_time() const { return ms(clock_ns_() - begin_ns_) > kBudgetMs; }

 private:
  Status take(const EglVariant& variant, size_t maps, std::vector<double>& took_ms) {
    const int64_t begin_ns = clock_ns_();
    Status taken = scene_.take(renderer_, variant, maps);
    took_ms.push_back(ms(clock_ns_() - begin_ns));
    return taken;
  }

  MapRenderer& renderer_;
  const std::function<int64_t()>& clock_ns_;
  MeasuredScene scene_;
  const int64_t begin_ns_;
};

void drop_hopeless(std::vector<Samples>& all) {
  double best_ms = std::numeric_limits<double>::infinity();
  for (Samples& samples : all) best_ms = std::min(best_ms, samples.timing().cost_ms());
  for (Samples& samples : all) samples.dropped = samples.timing().cost_ms() > kHopeless * best_ms;
}

}  // namespace

double EglTiming::cost_ms() const {
  return 0.5 * (alone_ms + round_ms / static_cast<double>(kMeasuredSessions));
}

Result<std::vector<EglTiming>> measure_egl_variants(MapRenderer& renderer, std::span<const EglVariant> variants,
                                                    const std::function<int64_t()>& clock_ns) {
  Measurement measurement(renderer, clock_ns);
  std::vector<Samples> all;
  for (const EglVariant& variant : variants) all.push_back({variant, {}, {}});
  // Each variant's first frame compiles shaders, makes buffers and uploads the scene; the second is the first that counts.
  for (int i = 0; i <= kFrames; ++i) {
    for (Samples& samples : all) {
      if (samples.dropped || (i > 1 && measurement.out_of_time())) continue;
      if (Status done = measurement.frame(samples); !done) return tl::unexpected(done.error());
      if (i == 0) samples.alone_ms.clear(), samples.round_ms.clear();
    }
    if (i == 1) drop_hopeless(all);
  }
  std::vector<EglTiming> timings;
  for (Samples& samples : all) timings.push_back(samples.timing());
  return timings;
}

const EglTiming& fastest(std::span<const EglTiming> timings) {
  double best_ms = std::numeric_limits<double>::infinity();
  for (const EglTiming& timing : timings) best_ms = std::min(best_ms, timing.cost_ms());
  return *std::find_if(timings.begin(), timings.end(),
                       [&](const EglTiming& timing) { return timing.cost_ms() <= kAsFast * best_ms; });
}

size_t best_batch(const EglTiming& timing) {
  constexpr double kMostBatch = 64.0, kShareOfSubmission = 0.1;
  const double maps_ms = (timing.round_ms - timing.alone_ms) / static_cast<double>(kMeasuredSessions - 1);
  const double submission_ms = timing.alone_ms - maps_ms;
  if (submission_ms <= 0) return 1;
  if (maps_ms <= 0) return static_cast<size_t>(kMostBatch);
  return static_cast<size_t>(std::clamp(std::ceil(submission_ms / (kShareOfSubmission * maps_ms)), 1.0, kMostBatch));
}

}  // namespace sightline
