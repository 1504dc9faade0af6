#include "client/evaluate/evaluation.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <thread>

#include "client/page/contact_sheet.h"
#include "client/scenario/scenario_limits.h"
#include "client/truth/asked_frames.h"
#include "client/truth/free_way.h"
#include "server/sample/embree_sampler.h"

namespace sightline {
namespace {

// The share of a run's progress that playing counts for; judging is the rest.
constexpr double kPlayShare = 0.2;

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

tl::unexpected<Error> in_scene(const SceneCase& scene, Error error) {
  error.field = scene.name + " seed " + std::to_string(scene.seed) + (error.field.empty() ? "" : ": ") + error.field;
  return tl::unexpected(std::move(error));
}

// The state that all threads share. Every member may be used from many threads.
struct Shared {
  // `given` may be null; then this makes Embree's.
  explicit Shared(SamplerDevice* given)
      : embree_samplers(given != nullptr ? nullptr : make_embree_sampler_device()),
        samplers(given != nullptr ? *given : *embree_samplers) {}

  GeometryStore store;
  EmbreeDevice device;
  std::unique_ptr<SamplerDevice> embree_samplers;
  SamplerDevice& samplers;
  ExtentCache extents;
};

Result<Scenario> load_case(const SceneCase& scene, Shared& shared) {
  auto scenario = scene.load(shared.store);
  if (!scenario) return in_scene(scene, scenario.error());
  const std::vector<ScenarioActor> targets = scenario->targets();
  if (std::none_of(targets.begin(), targets.end(), [](const auto& target) { return target.weight > 0; }))
    return in_scene(scene, Error{ErrorCode::kInvalidArgument, "nodes", "no node is a target with a weight above 0"});
  return scenario;
}

double length_s(const Scenario& scenario, const EvaluationOptions& options) {
  return options.duration_s > 0 ? std::min(options.duration_s, scenario.duration_s()) : scenario.duration_s();
}

// The mean progress of all runs.
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
  std::vector<std::vector<ReportedShare>> reports;  // by frame; empty when the policy reports nothing
  std::vector<std::optional<bool>> tracking;        // by frame
  std::vector<std::optional<glm::dvec3>> goals_m;   // by frame
  std::vector<AskedPlace> asked_places;             // in the order of time
  std::vector<ReasonClaim> claims;                  // in the order of time
  std::optional<size_t> pair_volumes;               // number of frames with one; none when the policy does not say
};

// One policy in one scene.
class Run {
 public:
  Run(const SceneCase& scene, const PolicyEntry& policy, const EvaluationOptions& options, int threads, Shared& shared,
      std::function<void(double)> progress)
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
    const auto limits = limits_of(*scenario);
    if (!limits) return in_scene(scene_, limits.error());
    limits_ = *limits;
    record_.scene = scene_.name;
    record_.seed = scene_.seed;
    record_.policy = policy_.name;
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
    failed.value().field = policy_.name + " in " + failed.value().field;
    return failed;
  }

  Result<Played> play(const Scenario& scenario) {
    const auto ticks = static_cast<size_t>(std::floor(length_s(scenario, options_) * options_.rate_hz + 1e-9)) + 1;
    PolicySite site{scenario,
                    shared_.store,
                    shared_.device,
                    shared_.samplers,
                    shared_.extents,
                    limits_,
                    1 / options_.rate_hz,
                    scene_.seed,
                    ticks,
                    static_cast<size_t>(options_.picture_every)};
    auto policy = policy_.make(site);
    if (!policy) return tl::unexpected(policy.error());
    Played played;
    double steps_s = 0.0;
    for (size_t k = 0; k < ticks; ++k) {
      const double time_s = static_cast<double>(k) / options_.rate_hz;
      const auto start = std::chrono::steady_clock::now();
      auto step = (*policy)->next(time_s, k == 0 ? 0.0 : site.tick_s);
      steps_s += seconds_since(start);
      if (!step) return tl::unexpected(step.error());
      played.frames.push_back({time_s, step->camera, step->lens, step->jump});
      if (step->reports) played.reports.push_back(std::move(*step->reports));
      played.tracking.push_back(step->tracking);
      played.goals_m.push_back(step->goal_m);
      if (step->asked_place) played.asked_places.push_back(*step->asked_place);
      if (step->claim) played.claims.push_back(std::move(*step->claim));
      if (step->pair_volume) played.pair_volumes = played.pair_volumes.value_or(0) + *step->pair_volume;
      progress_(kPlayShare * static_cast<double>(k) / static_cast<double>(ticks));
    }
    if (played.pair_volumes) record_.pair_volume_share = double(*played.pair_volumes) / static_cast<double>(ticks);
    record_.most_joint = (*policy)->most_joint(), record_.most_worth = (*policy)->most_worth();
    record_.timing.step_ms = 1000 * steps_s / static_cast<double>(ticks);
    return played;
  }

  Status judge_run(const Scenario& scenario, const Played& played) {
    JudgeOptions judging;
    judging.picture_every = options_.picture_every;
    judging.picture_size = options_.picture_size;
    judging.threads = threads_;
    judging.progress = [&](size_t done) {
      progress_(kPlayShare + (1 - kPlayShare) * static_cast<double>(done) / static_cast<double>(played.frames.size()));
    };
    const auto truths = judge(scenario, shared_.store, shared_.device, played.frames, judging);
    if (!truths) return tl::unexpected(truths.error());
    record_.metrics = summarize(scenario, played.frames, *truths, limits_);
    record_.target_count = record_.metrics.targets.size();
    judge_words(scenario, played, *truths);
    for (size_t i = 0; i < truths->size(); ++i)
      if (const auto& picture = (*truths)[i].picture)
        record_.pictures.push_back({played.frames[i].time_s, played.frames[i].camera.position_m,
                                    picture->least_whole_share(), picture->fully_hidden(), played.tracking[i]});
    auto world = ScenarioWorld::make(scenario, shared_.store, shared_.device);
    if (!world) return tl::unexpected(world.error());
    const bool same_targets = scenario.target_changes_s().empty();
    if (same_targets) record_.reaction = measure_reaction(**world, played.frames);
    record_.longest_blind_with_way_s = longest_blind_with_way_s(**world, played.frames, *truths, limits_);
    if (auto drawn = draw_sheet(**world, played.frames); !drawn) return drawn;
    judge_against_targets(**world, played, *truths);
    if (same_targets) record_.obstructions = check_obstructions(**world, played.asked_places);
    record_.reasons = check_reasons(**world, shared_.extents, played.claims);
    return {};
  }

  Status draw_sheet(ScenarioWorld& world, std::span<const CameraFrame> frames) const {
    if (options_.sheets.empty()) return {};
    constexpr int kQuality = 80;
    const std::vector<uint8_t> bytes = encode_jpeg(
        contact_sheet(world, frames, {.columns = 4, .rows = 2, .panel_width = 240}), kQuality);
    const std::filesystem::path path = std::filesystem::path(options_.sheets) /
                                       (scene_.name + "-" + std::to_string(scene_.seed) + "-" + policy_.name + ".jpg");
    std::ofstream file(path, std::ios::binary);
    file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    if (!file.flush()) return fail(ErrorCode::kUnavailable, path.string(), "cannot be written");
    return {};
  }

  // Compares the policy's reports and its status with the truth.
  void judge_words(const Scenario& scenario, const Played& played, std::span<const FrameTruth> truths) {
    if (!played.reports.empty()) record_.reports = judge_reports(truths, played.reports);
    if (std::none_of(played.tracking.begin(), played.tracking.end(), [](const auto& t) { return t.has_value(); }))
      return;
    std::vector<uint64_t> required_ids;
    for (const ScenarioActor& target : scenario.targets())
      if (target.required && target.weight > 0.0) required_ids.push_back(target.id);
    record_.status = judge_status(truths, played.tracking, required_ids);
  }

  // How the camera and its goal move, against the motion of the targets.
  void judge_against_targets(ScenarioWorld& world, const Played& played, std::span<const FrameTruth> truths) {
    std::vector<glm::dvec3> centers_m;
    std::vector<GoalSample> goals;
    for (size_t i = 0; i < played.frames.size(); ++i) {
      const CameraFrame& frame = played.frames[i];
      world.set_time(frame.time_s);
      centers_m.push_back(world.targets_center_m());
      goals.push_back({frame.time_s, played.goals_m[i], centers_m.back(), frame.jump || truths[i].other_targets});
    }
    if (world.scenario().target_changes_s().empty()) record_.turns = answers_to_turns(played.frames, centers_m);
    const bool asked = policy_.shot.number != 0;
    const double tolerance = asked ? policy_.shot.tolerance : 1.0;
    const std::vector<FrameShot> shots = asked ? shots_as_asked(policy_.shot, world, played.frames)
                                               : shots_as_begun(played.frames, centers_m);
    record_.coherence = coherence_of(played.frames, shots, truths, tolerance);
    record_.changes = answers_to_changes(played.frames, shots, truths, tolerance);
    if (std::any_of(goals.begin(), goals.end(), [](const GoalSample& g) { return g.goal_m.has_value(); }))
      record_.goals = goals_of(goals);
  }

  const SceneCase& scene_;
  const PolicyEntry& policy_;
  const EvaluationOptions& options_;
  const int threads_;
  Shared& shared_;
  const std::function<void(double)> progress_;
  CameraLimits limits_;  // of the scenario
  RunRecord record_;
};

// Calls work(i) for every i in [0, count); each of `threads` threads takes the next index that is left.
void for_each_index(size_t count, int threads, const std::function<void(size_t)>& work) {
  std::atomic<size_t> next{0};
  const auto loop = [&] {
    for (size_t i = next++; i < count; i = next++) work(i);
  };
  std::vector<std::jthread> others;
  for (int k = 1; k < threads; ++k) others.emplace_back(loop);
  loop();
}

}  // namespace

Result<std::vector<RunRecord>> evaluate(std::span<const SceneCase> cases, std::span<const PolicyEntry> policies,
                                        const EvaluationOptions& options) {
  Shared shared(options.samplers);
  const size_t runs = cases.size() * policies.size();
  const int jobs = std::max(1, options.jobs);
  // Cores that would have no run of their own help to judge.
  const int threads = std::max(1, jobs / static_cast<int>(std::max<size_t>(1, runs)));
  Progress progress(runs, options.progress);
  std::vector<std::optional<Result<RunRecord>>> results(runs);
  for_each_index(runs, jobs, [&](size_t i) {
    const SceneCase& scene = cases[i / policies.size()];
    const PolicyEntry& policy = policies[i % policies.size()];
    results[i] = Run(scene, policy, options, threads, shared, [&, i](double share) { progress.set(i, share); }).run();
  });
  std::vector<RunRecord> records;
  for (auto& result : results) {
    // The first failure in this order: which one is reported does not depend on the threads.
    if (!*result) return tl::unexpected(result->error());
    records.push_back(std::move(**result));
  }
  return records;
}

}  // namespace sightline
