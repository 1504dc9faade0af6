// Prints one line for each scene and set of settings, with two hashes. The first is over the camera's path. The second
// is over every step's whole answer and the data that led to it. Two builds that print equal lines compute the same
// bits; `diff` shows which scene changed. It takes Embree's maps, and the first seconds of every scene.
//
//   step_digest [scene ...]        without names: the scenes of the group `study` but the city
#include <cstdio>
#include <string>

#include "client/scenario/scenario_world.h"
#include "scenes/catalog.h"
#include "server/base/hash.h"
#include "server/paper/paper_settings.h"
#include "server/sample/embree_sampler.h"
#include "server/sample/extent.h"
#include "server/scene/gltf.h"
#include "server/step/step.h"
#include "tests/support/plain_settings.h"

namespace sightline {
namespace {

constexpr double kTickS = 1.0 / 60;
constexpr int kSteps = 240;

struct Case {
  std::string name;
  StepSettings settings;
};

std::vector<Case> cases() {
  std::vector<Case> all = {{"sightline", preset_settings(Preset::kSightline)},
                           {"paper", preset_settings(Preset::kPaper)},
                           {"paper-basic", paper_row(Strategy::kBasic, 0.0)},
                           {"paper-robust", paper_row(Strategy::kRobust, 0.3)}};
  StepSettings s = preset_settings(Preset::kSightline);
  s.sample.resolution = 16, s.aggregate.candidates = 4096;
  all.push_back({"sightline-wide", s});
  s = preset_settings(Preset::kSightline);
  s.aggregate.filter.mode = FilterMode::kJoint, s.aggregate.visibility_threshold = 1.0, s.sample.jitter = false;
  all.push_back({"sightline-joint", s});
  s = preset_settings(Preset::kSightline);
  s.aggregate.volume = Volume::kPair, s.aggregate.filter.mode = FilterMode::kNone, s.sample.points = 2;
  all.push_back({"sightline-pair", s});
  s = test::plain_settings();
  s.sample.points = 8, s.bound.horizon_s = 1.0;
  all.push_back({"basic-8", s});
  s.move.strategy = Strategy::kRobust, s.move.prediction_s = 0.3, s.aggregate.filter.mode = FilterMode::kPerTarget;
  all.push_back({"robust-8", s});
  return all;
}

class Digest {
 public:
  template <typename T>
  void add(std::span<const T> values) {
    hash_ = hash64_bytes(std::as_bytes(values), hash_);
  }
  template <typename T>
  void add_one(const T& value) {
    add(std::span(&value, 1));
  }
  void add_path(const StepResult& r) {
    add_one(r.camera.pose.position_m), add_one(r.camera.pose.rotation), add_one(r.camera.velocity_mps);
    add_one(r.camera.angular_velocity_radps), add_one(r.vertical_fov_rad);
  }
  void add(const StepResult& r) {
    add_path(r), add_one(r.status), add_one(r.reason);
    add_one(r.volume), add_one(r.pair_gap), add_one(r.chosen_candidate), add_one(r.flags.used_cube_map);
    add_one(r.flags.body_overlap);
    for (const TargetSight& t : r.targets) {
      add_one(t.id), add_one(t.visible_share), add_one(t.filtered_share), add_one(t.filtered_visible);
      add_one(t.in_picture), add_one(t.distance_m), add_one(t.main_occluder_id());
      add_one(t.picture_share), add_one(t.forecast ? t.forecast->share : -1.0);
    }
  }
  void add(const Stepper& stepper) {
    const CandidateSet& candidates = stepper.dump().sights.candidates;
    list_places(candidates.position_m, place_m_);
    add(std::span<const glm::dvec3>(place_m_));
    add(std::span<const uint32_t>(candidates.visible_targets)), add(candidates.filtered()), add(candidates.ahead());
    add(std::span<const double>(stepper.dump().sights.hidden));
    add_one(stepper.carried().shot.offset_m), add_one(stepper.carried().goal_m.value_or(glm::dvec3(0.0)));
  }
  uint64_t value() const { return hash_; }

 private:
  uint64_t hash_ = 0;
  std::vector<glm::dvec3> place_m_;
};

Status digest(const scenes::CatalogEntry& entry) {
  GeometryStore store;
  EmbreeDevice device;
  ExtentCache extents;
  const auto sampler_device = make_embree_sampler_device();
  const auto bytes = entry.make({});
  if (!bytes) return tl::unexpected(bytes.error());
  const auto asset = read_gltf(*bytes, nullptr, store);
  if (!asset) return tl::unexpected(asset.error());
  auto scenario = Scenario::from_asset(*asset);
  if (!scenario) return tl::unexpected(scenario.error());
  for (const Case& c : cases()) {
    const auto world = ScenarioWorld::make(*scenario, store, device);
    if (!world) return tl::unexpected(world.error());
    std::vector<std::shared_ptr<const ExtentTable>> tables;
    std::vector<const ExtentTable*> views;
    for (const Target& target : (*world)->targets()) {
      tables.push_back(extents.get((*world)->mirror().find(target.instance_id)->geometry));
      views.push_back(tables.back().get());
    }
    Stepper stepper;
    stepper.place_camera(scenario->camera(), glm::dvec3(0.0));
    const auto sampler = sampler_device->make_sampler();
    const CameraLimits limits;
    Digest path, digest;
    for (int i = 0; i < kSteps; ++i) {
      (*world)->set_time(i * kTickS);
      const StepInput input{(*world)->mirror(),
                            (*world)->targets(),
                            limits,
                            c.settings,
                            scenario->lens(),
                            1,
                            static_cast<uint64_t>(i),
                            kTickS,
                            views};
      const auto result = stepper.take(input, *sampler, [] { return int64_t{0}; });
      if (!result) return tl::unexpected(result.error());
      path.add_path(*result), digest.add(*result), digest.add(stepper);
    }
    std::printf("%-12s %-16s %016llx %016llx\n", std::string(entry.name).c_str(), c.name.c_str(),
                static_cast<unsigned long long>(path.value()), static_cast<unsigned long long>(digest.value()));
    std::fflush(stdout);
  }
  return {};
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  using namespace sightline;
  for (const scenes::CatalogEntry& entry : scenes::catalog()) {
    bool wanted = argc == 1 && entry.group == scenes::SceneGroup::kStudy && entry.name != "city";
    for (int i = 1; i < argc; ++i) wanted |= entry.name == argv[i];
    if (!wanted) continue;
    if (const auto ok = digest(entry); !ok) return std::fprintf(stderr, "%s\n", to_string(ok.error()).c_str()), 1;
  }
}
