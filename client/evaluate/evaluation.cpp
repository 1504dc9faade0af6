#include "client/evaluate/evaluation.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>
#include <thread>

#include "server/sample/embree_sampler.h"

namespace sightline {
namespace {

// Playing counts for this share of a run's progress, judging for the rest.
constexpr double kPlayShare = 0.2;

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

tl::unexpected<Error> in_scene(const SceneCase& scene, Error error) {
  error.field =
      scene.name + " seed " + std::to_string(scene.seed) + (error.field.empty() ? "" : ": ") + error.field;
  return tl::unexpected(std::move(error));
}

// What all threads share; all of it is safe to use from many.
struct Shared {
  GeometryStore store;
  EmbreeDevice device;
  std::unique_ptr<SamplerDevice> samplers = make_embree_sampler_device();
  ExtentCache extents;
};

Result<Scenario> load_case(const SceneCase& scene, Shared& shared) {
  auto scenario = scene.load(shared.store);
  if (!scenario) return in_scene(scene, scenario.error());
  const std::vector<ScenarioActor> targets = scenario->targets();
  if (std::none_of(targets.begin(), targets.end(), [](const auto& target) { return target.weight > 0; }))
    return in_scene(scene,
                    Error{ErrorCode::kInvalidArgument, "nodes", "no node is a target with a weight above 0"});
  return scenario;
}

double length_s(const Scenario& scenario, const EvaluationOptions& options) {
  return options.duration_s > 0 ? std::min(options.duration_s, scenario.duration_s()) : scenario.duration_s();
}

// Sums the threads' progress up.
class Progress {
 public:
  Progress(size_t parts, const std::function<void(double)>& show) : done_(parts, 0.0), show_(show) {}
  void set(size_t part, double share) {
    const std::lock_guard lock(mutex_);
    sum_ += share - done_[part];
    done_[part] = share;
    if (show_) show_(sum_ / static_cast<double>(done_.size()));
  }

 private:
  std::mutex mutex_;
  std::vector<double> done_;
  double sum_ = 0.0;
  const std::function<void(double)>& show_;
};

struct Played {
  std::vector<CameraFrame> frames;
  std::vector<std::vector<ReportedShare>> words;  // by frame; empty when the policy says nothing
};

// One policy in one scene.
class Run {
 public:
  Run(const SceneCase& scene, const PolicyEntry& policy, const EvaluationOptions& options, int threads,
      Shared& shared, std::function<void(double)> progress)
      : scene_(scene),
        policy_(policy),
        options_(options),
        threads_(threads),
        shared_(shared),
        progress_(std::move(progress)) {}

  Result<RunRecord> run() {
    const auto start = std::chrono::steady_clock::now();
    auto scenario = load_case(scene_, shared_);
    if (!scenario) return tl::unexpected(scenario.error());
    record_.scene = scene_.name;
    record_.seed = scene_.seed;
    record_.policy = policy_.name;
    record_.rate_hz = options_.rate_hz;
    auto played = play(*scenario);
    if (!played) return in_policy(played.error());
    if (auto judged = judge_run(*scenario, *played); !judged) return in_policy(judged.error());
    record_.timing.run_s = seconds_since(start);
    progress_(1.0);
    return std::move(record_);
  }

 private:
  tl::unexpected<Error> in_policy(Error error) const {
    auto failed = in_scene(scene_, std::move(error));
    failed.value().field = std::string(policy_.name) + " in " + failed.value().field;
    return failed;
  }

  Result<Played> play(const Scenario& scenario) {
    PolicySite site{scenario,        shared_.store,  shared_.device,       *shared_.samplers,
                    shared_.extents, CameraLimits{}, 1 / options_.rate_hz, scene_.seed};
    auto policy = make_policy(policy_, site);
    if (!policy) return tl::unexpected(policy.error());
    const auto ticks =
        static_cast<size_t>(std::floor(length_s(scenario, options_) * options_.rate_hz + 1e-9)) + 1;
    Played played;
    double steps_s = 0.0;
    for (size_t k = 0; k < ticks; ++k) {
      const double time_s = static_cast<double>(k) / options_.rate_hz;
      const auto start = std::chrono::steady_clock::now();
      auto step = (*policy)->next(time_s, k == 0 ? 0.0 : site.tick_s);
      steps_s += seconds_since(start);
      if (!step) return tl::unexpected(step.error());
      played.frames.push_back({time_s, step->camera, step->lens, step->jump});
      record_.path_m.push_back(step->camera.position_m);
      if (step->words) played.words.push_back(std::move(*step->words));
      progress_(kPlayShare * static_cast<double>(k) / static_cast<double>(ticks));
    }
    record_.timing.step_ms = 1000 * steps_s / static_cast<double>(ticks);
    return played;
  }

  Status judge_run(const Scenario& scenario, const Played& played) {
    JudgeOptions judging;
    judging.picture_every = options_.picture_every;
    judging.picture_size = options_.picture_size;
    judging.threads = threads_;
    judging.progress = [&](size_t done) {
      progress_(kPlayShare +
                (1 - kPlayShare) * static_cast<double>(done) / static_cast<double>(played.frames.size()));
    };
    const auto truths = judge(scenario, shared_.store, shared_.device, played.frames, judging);
    if (!truths) return tl::unexpected(truths.error());
    record_.metrics = summarize(scenario, played.frames, *truths, CameraLimits{});
    record_.target_count = record_.metrics.targets.size();
    if (!played.words.empty()) record_.words = judge_reports(*truths, played.words);
    for (size_t i = 0; i < truths->size(); ++i)
      if (const auto& picture = (*truths)[i].picture)
        record_.sights.push_back({played.frames[i].time_s, least_share(*picture)});
    auto world = ScenarioWorld::make(scenario, shared_.store, shared_.device);
    if (!world) return tl::unexpected(world.error());
    record_.reaction = measure_reaction(**world, played.frames);
    return {};
  }

  static double least_share(const PictureTruth& picture) {
    double least = 1.0;
    for (const TargetTruth& target : picture.targets) least = std::min(least, target.visible_share());
    return least;
  }

  const SceneCase& scene_;
  const PolicyEntry& policy_;
  const EvaluationOptions& options_;
  const int threads_;
  Shared& shared_;
  const std::function<void(double)> progress_;
  RunRecord record_;
};

glm::dvec2 on_plan(const glm::dvec3& p) {
  return {p.x, p.z};
}

Result<ScenePlan> make_plan(const SceneCase& scene, const EvaluationOptions& options, Shared& shared) {
  auto scenario = load_case(scene, shared);
  if (!scenario) return tl::unexpected(scenario.error());
  auto world = ScenarioWorld::make(*scenario, shared.store, shared.device);
  if (!world) return in_scene(scene, world.error());
  ScenePlan plan{scene.name, scene.seed, {}, {}, {}};
  const double height_m = (*world)->targets_center_m().y;
  plan.walls = cut_level((*world)->mirror(), height_m, false, (*world)->targets());
  plan.movers = cut_level((*world)->mirror(), height_m, true, (*world)->targets());
  plan.targets_m.resize((*world)->targets().size());
  const auto places = static_cast<size_t>(std::floor(10 * length_s(*scenario, options) + 1e-9)) + 1;
  for (size_t i = 0; i < places; ++i) {
    (*world)->set_time(static_cast<double>(i) / 10);
    for (size_t k = 0; k < plan.targets_m.size(); ++k)
      plan.targets_m[k].push_back(
          on_plan(aim_point_m(*(*world)->mirror().find((*world)->targets()[k].instance_id))));
  }
  return plan;
}

// Calls work(i) for i in [0, count) on `threads` threads, each taking the next that is left.
void for_each_index(size_t count, int threads, const std::function<void(size_t)>& work) {
  std::atomic<size_t> next{0};
  const auto loop = [&] {
    for (size_t i = next++; i < count; i = next++) work(i);
  };
  std::vector<std::jthread> others;
  for (int k = 1; k < threads; ++k) others.emplace_back(loop);
  loop();
}

// Values, or the error of the first part in order that failed: which one is reported does not depend on the
// threads.
template <typename T>
Result<std::vector<T>> all_of(std::vector<std::optional<Result<T>>> parts) {
  std::vector<T> values;
  for (auto& part : parts) {
    if (!*part) return tl::unexpected(part->error());
    values.push_back(std::move(**part));
  }
  return values;
}

// Where a triangle meets the plane: its corners on the two sides of it give two points.
void cut_triangle(const std::array<glm::dvec3, 3>& corners, double height_m,
                  std::vector<PlanSegment>& segments) {
  std::array<glm::dvec2, 3> points;
  size_t count = 0;
  for (size_t k = 0; k < 3; ++k) {
    const glm::dvec3 &a = corners[k], &b = corners[(k + 1) % 3];
    if ((a.y > height_m) == (b.y > height_m)) continue;
    const double share = (height_m - a.y) / (b.y - a.y);
    points[count++] = on_plan(a + (b - a) * share);
  }
  if (count == 2) segments.push_back({points[0], points[1]});
}

}  // namespace

std::vector<PlanSegment> cut_level(const SceneMirror& mirror, double height_m, bool moving,
                                   std::span<const Target> targets) {
  std::vector<PlanSegment> segments;
  for (const Instance& instance : mirror.instances()) {
    if (!instance.geometry || !(instance.collides() || instance.occludes()) || instance.moving != moving)
      continue;
    if (std::abs(instance.center_m.y - height_m) > instance.radius_m) continue;
    if (std::any_of(targets.begin(), targets.end(),
                    [&](const Target& t) { return t.instance_id == instance.id; }))
      continue;
    const Geometry& geometry = *instance.geometry;
    for (size_t t = 0; t < geometry.triangle_count(); ++t) {
      std::array<glm::dvec3, 3> corners;
      for (size_t k = 0; k < 3; ++k)
        corners[k] = transform_point(instance.world_from_instance,
                                     glm::dvec3(geometry.positions[geometry.indices[3 * t + k]]));
      cut_triangle(corners, height_m, segments);
    }
  }
  return segments;
}

Result<Evaluation> evaluate(std::span<const SceneCase> cases, std::span<const PolicyEntry* const> policies,
                            const EvaluationOptions& options) {
  Shared shared;
  const size_t runs = cases.size() * policies.size();
  const int jobs = std::max(1, options.jobs);
  // Cores that would have no run of their own help to judge.
  const int threads = std::max(1, jobs / static_cast<int>(std::max<size_t>(1, runs)));
  Progress progress(runs, options.progress);
  std::vector<std::optional<Result<RunRecord>>> records(runs);
  for_each_index(runs, jobs, [&](size_t i) {
    const SceneCase& scene = cases[i / policies.size()];
    const PolicyEntry& policy = *policies[i % policies.size()];
    records[i] =
        Run(scene, policy, options, threads, shared, [&, i](double share) { progress.set(i, share); }).run();
  });
  auto all_runs = all_of(std::move(records));
  if (!all_runs) return tl::unexpected(all_runs.error());
  std::vector<std::optional<Result<ScenePlan>>> plans(cases.size());
  for_each_index(cases.size(), jobs, [&](size_t i) { plans[i] = make_plan(cases[i], options, shared); });
  auto all_plans = all_of(std::move(plans));
  if (!all_plans) return tl::unexpected(all_plans.error());
  return Evaluation{std::move(*all_plans), std::move(*all_runs)};
}

}  // namespace sightline
