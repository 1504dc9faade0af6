// Measures the stages of a step on the city as candidates, maps and targets grow. Further targets walk beside and
// behind the city's own two. Figures are medians of this thread's processor time. The rows "in turn" have a hundred
// cameras that step one after the other, as in a daemon with a hundred sessions. Each then finds the caches as the
// others left them.
//
//   stage_bench [steps] [settings]        steps per row, 300 without; only the rows of that name
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "client/scenario/scenario_world.h"
#include "client/truth/metrics.h"
#include "server/paper/paper_settings.h"
#include "server/sample/embree_sampler.h"
#include "tests/bench/step_timing.h"

namespace sightline {
namespace {

constexpr double kTickS = 1.0 / 60;
constexpr int kWarmUpSteps = 30;
constexpr size_t kInTurn = 100;

int64_t thread_ns() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return int64_t{1'000'000'000} * now.tv_sec + now.tv_nsec;
}

struct Row {
  std::string name;
  size_t targets;
  StepSettings settings;
  size_t cameras = 1;
};

StepSettings with(StepSettings settings, int resolution, int candidates, int points) {
  settings.sample.resolution = resolution;
  settings.aggregate.candidates = candidates;
  settings.sample.points = points;
  return settings;
}

std::vector<Row> rows() {
  const StepSettings sightline = preset_settings(Preset::kSightline), plain = paper_row(Strategy::kBasic, 0.0);
  StepSettings lattice = plain;
  lattice.aggregate.volume = Volume::kLattice;
  lattice.bound.mode = BoundMode::kHorizon;
  std::vector<Row> all = {{"default", 2, with(sightline, 7, 343, 8)},
                          {"plain, pairs", 2, with(plain, 7, 343, 1)},
                          {"plain, point", 2, with(lattice, 7, 343, 0)},
                          {"plain", 2, with(lattice, 7, 343, 8)},
                          {"plain, in turn", 2, with(lattice, 7, 343, 8), kInTurn},
                          {"default, in turn", 2, with(sightline, 7, 343, 8), kInTurn},
                          {"plain, r = 32", 2, with(lattice, 32, 32768, 0)},
                          {"plain wide", 8, with(lattice, 16, 4096, 8)},
                          {"default wide", 8, with(sightline, 16, 4096, 8)}};
  for (const size_t targets : {1, 2, 4, 8, 16, 32}) all.push_back({"default", targets, with(sightline, 7, 343, 8)});
  for (const int candidates : {343, 1024, 4096, 16384})
    all.push_back({"default", 2, with(sightline, 7, candidates, 8)});
  return all;
}

// The city with the given number of walkers, at least its own two. Further ones walk in a grid behind the first, as
// seen from the camera's start.
class Walkers {
 public:
  static Result<std::unique_ptr<Walkers>> make(LoadedScene& city, size_t count) {
    std::unique_ptr<Walkers> walkers(new Walkers(*city.scenario));
    std::vector<NodeBinding> bindings;
    for (const ScenarioActor& actor : city.scenario->actors()) bindings.push_back({actor.name, actor.id});
    auto instances = instantiate(city.scenario->asset(), bindings, city.store);
    if (!instances) return tl::unexpected(instances.error());
    for (size_t i = 0; i < bindings.size(); ++i) (*instances)[i].moving = true;
    const std::vector<ScenarioActor> own = city.scenario->targets();
    for (size_t i = 0; i < count; ++i) walkers->add(i < own.size() ? own[i].id : 0, i, *instances);
    SceneDelta delta;
    delta.add = std::move(*instances);
    delta.asset_ids_allowed = true;
    if (auto ok = walkers->mirror.apply(delta, {}); !ok) return tl::unexpected(ok.error());
    for (const Target& target : walkers->targets)
      walkers->tables_.push_back(city.extents.get(walkers->mirror.find(target.instance_id)->geometry));
    for (const auto& table : walkers->tables_) walkers->extents.push_back(table.get());
    return walkers;
  }

  void set_time(double time_s) {
    update_.ids.clear(), update_.poses.clear();
    const std::vector<Pose> poses = scenario_.poses_at(time_s);
    for (size_t i = 0; i < poses.size(); ++i)
      update_.ids.push_back(scenario_.actors()[i].id), update_.poses.push_back(poses[i]);
    for (size_t k = 0; k < added_.size(); ++k) {
      Pose pose = poses[0];
      pose.position_m += added_[k];
      update_.ids.push_back(kFirstId + k), update_.poses.push_back(pose);
    }
    const auto ok = mirror.apply({}, update_);
    if (!ok) std::fprintf(stderr, "%s\n", to_string(ok.error()).c_str());
  }

  SceneMirror mirror;
  std::vector<Target> targets;
  std::vector<const ExtentTable*> extents;

 private:
  static constexpr uint64_t kFirstId = 1'000'000;
  explicit Walkers(const Scenario& scenario) : scenario_(scenario) {}

  void add(uint64_t id, size_t index, std::vector<NewInstance>& instances) {
    Target& target = targets.emplace_back();
    target.instance_id = id != 0 ? id : kFirstId + added_.size();
    if (id != 0) return;
    NewInstance& walker = instances.emplace_back(instances[0]);
    walker.id = target.instance_id;
    const double abreast = 0.9 * (static_cast<double>(index % 6) - 2.5),
                 behind = 1.1 * static_cast<double>(index / 6 + 1);
    glm::dvec3 away = walker.pose.position_m - scenario_.camera().position_m;
    away = glm::normalize(glm::dvec3(away.x, 0.0, away.z));
    added_.push_back(behind * away + abreast * glm::dvec3(-away.z, 0.0, away.x));
    walker.pose.position_m += added_.back();
  }

  const Scenario& scenario_;
  std::vector<glm::dvec3> added_;  // from the first actor
  std::vector<std::shared_ptr<const ExtentTable>> tables_;
  TransformUpdate update_;
};

// One camera over a city of its own.
struct Camera {
  std::unique_ptr<Walkers> world;
  std::unique_ptr<Sampler> sampler;
  Stepper stepper;
};

Result<std::unique_ptr<Camera>> make_camera(LoadedScene& city, SamplerDevice& device, size_t targets) {
  auto world = Walkers::make(city, targets);
  if (!world) return tl::unexpected(world.error());
  auto camera = std::make_unique<Camera>(Camera{std::move(*world), device.make_sampler(), {}});
  camera->stepper.place_camera(city.scenario->camera(), glm::dvec3(0.0));
  return camera;
}

struct Times {
  std::vector<double> sample_ms, aggregate_ms, move_ms, total_ms, candidates;
};

Status step(const LoadedScene& city, Camera& camera, const StepSettings& settings, int tick, Times& times) {
  Walkers& world = *camera.world;
  world.set_time(tick % 600 * kTickS);
  const CameraLimits limits;
  const StepInput input{
      world.mirror, world.targets, limits, settings, city.scenario->lens(), 1, static_cast<uint64_t>(tick),
      kTickS,       world.extents};
  const int64_t begin_ns = thread_ns();
  const auto result = camera.stepper.take(input, *camera.sampler, thread_ns);
  const int64_t end_ns = thread_ns();
  if (!result) return tl::unexpected(result.error());
  if (tick < kWarmUpSteps) return {};
  const auto ms = [&](Stage stage) { return 1e-6 * static_cast<double>(result->stage_ns[static_cast<size_t>(stage)]); };
  times.sample_ms.push_back(ms(Stage::kSample)), times.aggregate_ms.push_back(ms(Stage::kAggregate));
  times.move_ms.push_back(ms(Stage::kMove)), times.total_ms.push_back(1e-6 * static_cast<double>(end_ns - begin_ns));
  times.candidates.push_back(static_cast<double>(camera.stepper.dump().sights.counts.total));
  return {};
}

Status run(LoadedScene& city, SamplerDevice& device, const Row& row, int steps) {
  std::vector<std::unique_ptr<Camera>> cameras;
  for (size_t k = 0; k < row.cameras; ++k) {
    auto camera = make_camera(city, device, row.targets);
    if (!camera) return tl::unexpected(camera.error());
    cameras.push_back(std::move(*camera));
  }
  Times times;
  for (int i = 0; i < kWarmUpSteps + steps; ++i)
    for (const auto& camera : cameras)
      if (auto ok = step(city, *camera, row.settings, i, times); !ok) return ok;
  const auto p = [](const std::vector<double>& values, double share) { return percentile(values, share); };
  std::printf("%-16s %7zu %10.0f %4d %6zu %8.3f %9.3f %8.3f %8.3f  %8.3f %8.3f\n", row.name.c_str(), row.targets,
              p(times.candidates, 0.5), row.settings.sample.resolution, cameras[0]->stepper.dump().plan.requests.size(),
              p(times.sample_ms, 0.5), p(times.aggregate_ms, 0.5), p(times.move_ms, 0.5), p(times.total_ms, 0.5),
              p(times.total_ms, 0.1), p(times.total_ms, 0.95));
  std::fflush(stdout);
  return {};
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  using namespace sightline;
  const auto city = LoadedScene::load("city");
  if (!city) return std::fprintf(stderr, "%s\n", to_string(city.error()).c_str()), 1;
  const auto device = make_embree_sampler_device();
  std::printf("%-16s %7s %10s %4s %6s %8s %9s %8s %8s  %8s %8s   (ms)\n", "settings", "targets", "candidates", "r",
              "maps", "sample", "aggregate", "move", "total", "p10", "p95");
  for (const Row& row : rows())
    if (argc > 2 && row.name != argv[2])
      continue;
    else if (const auto ok = run(**city, *device, row, argc > 1 ? std::atoi(argv[1]) : 300); !ok)
      return std::fprintf(stderr, "%s\n", to_string(ok.error()).c_str()), 1;
}
