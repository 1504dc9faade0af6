#include "tests/bench/step_timing.h"

#include <chrono>

#include "client/truth/metrics.h"
#include "scenes/catalog.h"
#include "server/paper/paper_settings.h"
#include "server/sample/egl_sampler.h"
#include "server/sample/embree_sampler.h"
#include "server/scene/gltf.h"

namespace sightline {
namespace {

constexpr double kTickS = 1.0 / 60;

int64_t monotonic_ns() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

double to_ms(int64_t ns) {
  return 1e-6 * static_cast<double>(ns);
}

Percentiles percentiles(const std::vector<double>& values_ms) {
  return {percentile(values_ms, 0.5), percentile(values_ms, 0.95)};
}

}  // namespace

std::vector<TimedSettings> timed_settings() {
  return {{"paper", paper_row(Strategy::kBasic, 0.0)},
          {"sightline", preset_settings(Preset::kSightline)},
          {"default", preset_settings(Preset::kSightline), true}};
}

int timed_candidates(const TimedSettings& timed, int resolution) {
  if (!timed.as_they_are) return resolution * resolution * resolution;
  return resolution == timed.settings.sample.resolution ? timed.settings.aggregate.candidates : 0;
}

std::vector<std::unique_ptr<SamplerDevice>> timed_samplers(std::string* no_egl) {
  std::vector<std::unique_ptr<SamplerDevice>> devices;
  auto egl = make_egl_sampler_device({});
  if (no_egl) *no_egl = egl ? "" : to_string(egl.error());
  if (egl) devices.push_back(std::move(*egl));
  devices.push_back(make_embree_sampler_device());
  return devices;
}

Result<std::unique_ptr<LoadedScene>> LoadedScene::load(const std::string& name) {
  const scenes::CatalogEntry* entry = scenes::find_scene(name);
  if (!entry) return fail(ErrorCode::kNotFound, "scene", "no generated scene is named \"" + name + '"');
  const auto file = entry->make({});
  if (!file) return tl::unexpected(file.error());
  auto scene = std::make_unique<LoadedScene>();
  const auto asset = read_gltf(*file, nullptr, scene->store);
  if (!asset) return tl::unexpected(asset.error());
  auto scenario = Scenario::from_asset(*asset);
  if (!scenario) return tl::unexpected(scenario.error());
  scene->scenario = std::make_unique<Scenario>(std::move(*scenario));
  const auto world = ScenarioWorld::make(*scene->scenario, scene->store, scene->device);
  if (!world) return tl::unexpected(world.error());
  for (const Target& target : (*world)->targets())
    scene->tables.push_back(scene->extents.get((*world)->mirror().find(target.instance_id)->geometry));
  return scene;
}

Result<std::unique_ptr<StepTimer>> StepTimer::make(LoadedScene& scene, SamplerDevice& device, StepSettings settings,
                                                   int resolution, int candidates) {
  settings.sample.resolution = resolution;
  settings.aggregate.candidates = candidates;
  if (auto ok = validate(settings); !ok) return tl::unexpected(ok.error());
  auto world = ScenarioWorld::make(*scene.scenario, scene.store, scene.device);
  if (!world) return tl::unexpected(world.error());
  return std::unique_ptr<StepTimer>(new StepTimer(scene, device, settings, std::move(*world)));
}

StepTimer::StepTimer(LoadedScene& scene, SamplerDevice& device, StepSettings settings,
                     std::unique_ptr<ScenarioWorld> world)
    : scene_(scene), settings_(settings), world_(std::move(world)), sampler_(device.make_sampler()) {
  for (const auto& table : scene.tables) tables_.push_back(table.get());
}

void StepTimer::to_next_frame() {
  const auto frames = static_cast<uint64_t>(scene_.scenario->duration_s() / kTickS);
  const uint64_t frame = tick_ % frames;
  if (frame == 0) stepper_.place_camera(scene_.scenario->camera(), glm::dvec3(0.0));
  world_->set_time(static_cast<double>(frame) * kTickS);
}

Result<double> StepTimer::step() {
  to_next_frame();
  const int64_t begin_ns = monotonic_ns();
  const StepInput input{
      world_->mirror(), world_->targets(), limits_, settings_, scene_.scenario->lens(), 1, tick_, kTickS, tables_};
  const auto result = stepper_.take(input, *sampler_, monotonic_ns);
  const double total_ms = to_ms(monotonic_ns() - begin_ns);
  if (!result) return tl::unexpected(result.error());
  if (tick_++ < kWarmUpSteps) return total_ms;
  const auto stage_ms = [&](Stage stage) { return to_ms(result->stage_ns[static_cast<size_t>(stage)]); };
  sample_ms_.push_back(stage_ms(Stage::kSample));
  aggregate_ms_.push_back(stage_ms(Stage::kAggregate));
  move_ms_.push_back(stage_ms(Stage::kMove));
  total_ms_.push_back(total_ms);
  samples_.push_back(static_cast<double>(stepper_.dump().sights.counts.total));
  return total_ms;
}

StepTiming StepTimer::timing() const {
  StepTiming timing;
  timing.frames = total_ms_.size();
  timing.samples = static_cast<size_t>(percentile(samples_, 0.5));
  timing.sample = percentiles(sample_ms_);
  timing.aggregate = percentiles(aggregate_ms_);
  timing.move = percentiles(move_ms_);
  timing.total = percentiles(total_ms_);
  return timing;
}

}  // namespace sightline
