// A step allocates nothing once its memory has grown to what it needs. The test counts every call of the allocator over
// 10,000 steps in a world of walkers, pillars and movers. It is a program of its own because it replaces the allocator.
#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>

#include "server/paper/paper_settings.h"
#include "tests/support/world.h"

// glibc's own functions, under the names that it exports for programs that replace them.
extern "C" {
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);
void __libc_free(void*);
}

namespace {

// Per thread: whether it counts, and its allocations so far.
thread_local bool counting = false;
thread_local size_t allocations = 0;

void count() {
  if (counting) ++allocations;
}

}  // namespace

// operator new and its variants call these.
extern "C" {
void* malloc(size_t size) {
  return count(), __libc_malloc(size);
}
void* calloc(size_t number, size_t size) {
  return count(), __libc_calloc(number, size);
}
void* realloc(void* block, size_t size) {
  return count(), __libc_realloc(block, size);
}
void* memalign(size_t alignment, size_t size) {
  return count(), __libc_memalign(alignment, size);
}
void* aligned_alloc(size_t alignment, size_t size) {
  return count(), __libc_memalign(alignment, size);
}
int posix_memalign(void** block, size_t alignment, size_t size) {
  count();
  *block = __libc_memalign(alignment, size);
  return *block ? 0 : ENOMEM;
}
void free(void* block) {
  __libc_free(block);
}
}

namespace sightline::test {
namespace {

constexpr double kTickS = 1.0 / 60;
constexpr int kRoundSteps = 600;  // after one round all walkers are back where they started

// Allocations within the sampler do not count.
class Uncounted : public Sampler {
 public:
  explicit Uncounted(Sampler& sampler) : sampler_(sampler) {}
  Status take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) override {
    const bool counted = std::exchange(counting, false);
    auto taken = sampler_.take(mirror, requests, maps);
    counting = counted;
    return taken;
  }

 private:
  Sampler& sampler_;
};

// People in a ring, pillars, a wall, and carts that cross.
class Yard {
 public:
  Yard(const StepSettings& settings, int people, int parts)
      : device_(make_embree_sampler_device()), sampler_(device_->make_sampler()), settings_(settings) {
    add(1000, BoxShape{{20, 0.1f, 20}}, {0, -0.1, 0});
    add(1001, BoxShape{{3, 1.5f, 0.1f}}, {0, 1.5, 3.5});
    for (int i = 0; i < 6; ++i) add(1010 + i, BoxShape{{0.2f, 2, 0.2f}}, {1.5 * i - 4, 2, 2.2 + 0.4 * (i % 3)});
    for (int i = 0; i < 4; ++i) add(2000 + i, BoxShape{{0.4f, 0.8f, 0.4f}}, cart(i, 0.0)), moving_.push_back(2000 + i);
    for (int i = 0; i < people; ++i) {
      add(1 + i, CapsuleShape{0.3f, 0.6f}, person(i, 0.0));
      targets_.emplace_back().instance_id = 1 + i;
      views_.push_back(table_of(1 + i));
      for (int j = 0; j < parts; ++j) {
        const uint64_t id = 3000 + 10 * i + j;
        add(id, CapsuleShape{0.1f, 0.3f}, person(i, 0.0) + aside(j, 0.0));
        targets_.back().part_ids.push_back(id);
        part_views_.push_back(table_of(id));
      }
    }
    const glm::dvec3 at(0, 2, 8);
    stepper_.place_camera({at, look_rotation(-at, {0, 1, 0}, {1, 0, 0})}, glm::dvec3(0.0));
  }

  void set_size(int candidates, int resolution) {
    settings_.aggregate.candidates = candidates, settings_.sample.resolution = resolution;
  }
  void set_volume(Volume volume) { settings_.aggregate.volume = volume; }

  // The number of allocations in this many steps.
  size_t step(int steps, bool count_take, bool moves) {
    Uncounted uncounted(*sampler_);
    Sampler& sampler = count_take ? *sampler_ : uncounted;
    allocations = 0;
    for (int i = 0; i < steps; ++i) {
      if (moves) move(kTickS * static_cast<double>(tick_ % kRoundSteps));
      const StepInput input{mirror_, targets_, limits_, settings_, lens_, 1, tick_++, kTickS, views_, part_views_};
      counting = true;
      const auto result = stepper_.take(input, sampler, clock_);
      counting = false;
      if (!result) throw std::runtime_error(to_string(result.error()));
      statuses_[static_cast<size_t>(result->status)]++;
      without_sight_ += std::ranges::none_of(result->targets,
                                             [](const auto& target) { return target.visible_share > 0; });
    }
    return allocations;
  }
  // Every target is in a box of its own meanwhile, so the camera looks for a way to a view. Returns in how many steps
  // it saw none.
  int play_without_sight(int steps) {
    const int before = without_sight_;
    for (size_t i = 0; i < targets_.size(); ++i)
      add(5000 + i, BoxShape{{0.8f, 1.2f, 0.8f}},
          person(static_cast<int>(i), kTickS * static_cast<double>(tick_ % kRoundSteps)));
    step(steps, false, false);
    SceneDelta delta;
    for (size_t i = 0; i < targets_.size(); ++i) delta.remove.push_back(5000 + i);
    if (auto ok = mirror_.apply(delta, {}); !ok) throw std::runtime_error(to_string(ok.error()));
    return without_sight_ - before;
  }
  int steps_with(TrackingStatus status) const { return statuses_[static_cast<size_t>(status)]; }

 private:
  void add(uint64_t id, const Shape& shape, const glm::dvec3& at) {
    SceneDelta delta;
    delta.add.push_back({id, *store_.intern(*tessellate(shape)), Pose{at, {1, 0, 0, 0}}, glm::dmat3(1.0), {}});
    if (auto ok = mirror_.apply(delta, {}); !ok) throw std::runtime_error(to_string(ok.error()));
  }

  const ExtentTable* table_of(uint64_t id) {
    return tables_.emplace_back(extents_.get(mirror_.find(id)->geometry)).get();
  }

  // Of a limb that swings.
  static glm::dvec3 aside(int part, double time_s) {
    return {0.5 * std::cos(part + std::acos(-1.0) * time_s), 0.3 * part - 0.3,
            0.5 * std::sin(part + std::acos(-1.0) * time_s)};
  }
  glm::dvec3 person(int i, double time_s) const {
    const double angle = 2 * std::acos(-1.0) * (time_s / (kRoundSteps * kTickS) + 0.08 * i);
    return {3.0 * std::cos(angle), 0.9, 1.0 + 3.0 * std::sin(angle)};
  }
  glm::dvec3 cart(int i, double time_s) const {
    return {6 * std::sin(2 * std::acos(-1.0) * (time_s / 5 + 0.25 * i)), 0.8, 1.0 + 1.5 * i};
  }
  void move(double time_s) {
    update_.ids.clear(), update_.poses.clear();
    for (size_t i = 0; i < targets_.size(); ++i) {
      const glm::dvec3 at = person(static_cast<int>(i), time_s);
      tell(1 + i, at);
      for (size_t j = 0; j < targets_[i].part_ids.size(); ++j)
        tell(targets_[i].part_ids[j], at + aside(static_cast<int>(j), time_s));
    }
    for (size_t i = 0; i < moving_.size(); ++i) tell(moving_[i], cart(static_cast<int>(i), time_s));
    if (auto ok = mirror_.apply({}, update_); !ok) throw std::runtime_error(to_string(ok.error()));
  }
  void tell(uint64_t id, const glm::dvec3& at) {
    update_.ids.push_back(id), update_.poses.push_back({at, {1, 0, 0, 0}});
  }

  GeometryStore store_;
  ExtentCache extents_;
  std::unique_ptr<SamplerDevice> device_;
  std::unique_ptr<Sampler> sampler_;
  StepSettings settings_;
  const CameraLimits limits_;
  const Lens lens_;
  const StageClock clock_ = [] { return int64_t{0}; };
  SceneMirror mirror_;
  std::vector<Target> targets_;
  std::vector<std::shared_ptr<const ExtentTable>> tables_;
  std::vector<const ExtentTable*> views_, part_views_;
  std::vector<uint64_t> moving_;
  TransformUpdate update_;
  Stepper stepper_;
  uint64_t tick_ = 0;
  std::array<int, 7> statuses_{};
  int without_sight_ = 0;
};

struct Preset {
  const char* name;
  StepSettings settings;
  int people = 2;
  int parts = 0;  // of each
};

// Small maps and few candidates make the many steps quick, and the allocations are the same.
StepSettings changed(
    StepSettings settings, void (*change)(StepSettings&) = [](StepSettings&) {}) {
  settings.sample.resolution = 4, settings.sample.points = std::min(settings.sample.points, 3);
  settings.aggregate.candidates = 64, settings.move.viewpoint_search.resolution = 3;
  change(settings);
  return settings;
}

std::vector<Preset> presets() {
  const StepSettings sightline = preset_settings(sightline::Preset::kSightline);
  return {
      {"sightline", changed(sightline)},
      {"sightline_four_people", changed(sightline), 4},
      {"sightline_bodies", changed(sightline), 2, 3},
      {"sightline_joint", changed(sightline, [](StepSettings& s) { s.aggregate.filter.mode = FilterMode::kJoint; })},
      {"sightline_pairs", changed(sightline,
                                  [](StepSettings& s) {
                                    s.aggregate.volume = Volume::kPair, s.aggregate.filter.mode = FilterMode::kNone;
                                    s.move.strategy = Strategy::kRobust;
                                  })},
      {"robust", changed(sightline, [](StepSettings& s) { s.move.strategy = Strategy::kRobust; })},
      {"basic", changed(sightline, [](StepSettings& s) { s.move.strategy = Strategy::kBasic; })},
      {"paper", changed(preset_settings(sightline::Preset::kPaper))},
      {"paper_row", changed(paper_row(Strategy::kRobust, 0.3))},
      {"paper_stability", changed(paper_stability(6, 10))}};
}

class Allocation : public testing::TestWithParam<Preset> {};

TEST(AllocationCount, CountsWhatIsAllocated) {
  allocations = 0;
  counting = true;
  auto* const volatile block = new std::vector<int>(100);
  counting = false;
  EXPECT_EQ(allocations, 2u);
  delete block;
}

TEST_P(Allocation, ThereIsNoneInTenThousandSteadySteps) {
  Yard yard(GetParam().settings, GetParam().people, GetParam().parts);
  // The number of candidates varies with the bound, and that of a pair volume also with where the targets are. A round
  // with more of either grows the memory to its final size.
  const int candidates = GetParam().settings.aggregate.candidates, resolution = GetParam().settings.sample.resolution;
  yard.set_size(6 * candidates, resolution + 2);
  yard.set_volume(Volume::kLattice);  // rarely used beside pair volumes
  EXPECT_GT(yard.step(kRoundSteps, false, true), 0u) << "memory has to grow at first";
  yard.set_volume(GetParam().settings.aggregate.volume);
  yard.step(kRoundSteps, false, true);
  EXPECT_GT(yard.play_without_sight(600), 300);
  yard.set_size(candidates, resolution);
  yard.step(40'000, false, true);  // the camera takes another way in each round
  const int seen_before = yard.steps_with(TrackingStatus::kTracking);
  EXPECT_EQ(yard.step(10'000, false, true), 0u);
  const int seen = yard.steps_with(TrackingStatus::kTracking) - seen_before;
  EXPECT_GT(seen, 1000) << "all is seen now and then";
  EXPECT_LT(seen, 10'000) << "and not always";
}
INSTANTIATE_TEST_SUITE_P(Presets, Allocation, testing::ValuesIn(presets()),
                         [](const auto& tested) { return tested.param.name; });

}  // namespace
}  // namespace sightline::test
