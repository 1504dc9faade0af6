// Compares a step with simpler methods, and measures how it grows. The contenders of a section are measured in one run,
// frame by frame in turn, over the same scene.
//
//   speed_bench --out FOLDER [--quick] [--section NAME]...
//
// Writes FOLDER/rows.csv (percentiles of milliseconds) and FOLDER/ratios.csv. Sections: peers (with default), alone,
// wide, detail, blocks, targets, movers. tests/results/speed/make.sh makes the page of it.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "client/scenario/scenario_world.h"
#include "server/gl/software_renderer.h"
#include "server/sample/egl_sampler.h"
#include "server/sample/embree_sampler.h"
#include "tests/bench/speed/grid_city.h"
#include "tests/bench/speed/map_agreement.h"
#include "tests/bench/speed/peers.h"
#include "tests/bench/speed/plain_settings.h"
#include "tests/bench/speed/timed_steps.h"
#include "tests/bench/step_timing.h"

namespace sightline::bench {
namespace {

struct Bench {
  Tables tables;
  bool quick = false;
  std::vector<std::unique_ptr<SamplerDevice>> devices;  // EGL where there is one, and Embree

  int frames(int full) const { return TimedSteps::kWarmUpFrames + (quick ? std::max(20, full / 20) : full); }
};

StepSettings with_defaults(int resolution, int candidates) {
  StepSettings settings = preset_settings(Preset::kSightline);
  settings.sample.resolution = resolution;
  settings.aggregate.candidates = candidates;
  return settings;
}

// Rays from the targets' aim points to the candidates of the step that was just taken.
class TimedRays {
 public:
  TimedRays(std::string name, std::unique_ptr<RayPeer> peer) : peer_(std::move(peer)), agreement_(*peer_) {
    track.name = std::move(name);
  }

  void look(const SceneMirror& mirror, const std::vector<Target>& targets, const StepDump& dump, bool keep) {
    from_.clear();
    for (size_t i = 0; i < targets.size(); ++i)
      from_.push_back({dump.targets.tracked_targets[i].aim_m, *mirror.slot_of(targets[i].instance_id)});
    list_places(dump.sights.candidates.position_m, place_m_);
    const double begin_ms = now_ms();
    peer_->prepare();
    peer_->look(from_, place_m_, seen_);
    const double took_ms = now_ms() - begin_ms;
    if (!keep) return;
    track.total_ms.push_back(took_ms);
    track.candidates = seen_.size();
    agreement_.add(dump, from_, place_m_, seen_);
    track.agreement = agreement_.share();
    track.agreement_on_rays = agreement_.share_on_rays();
  }
  Track track;

 private:
  std::unique_ptr<RayPeer> peer_;
  std::vector<SeenFrom> from_;
  std::vector<glm::dvec3> place_m_;
  std::vector<uint32_t> seen_;
  MapAgreement agreement_;
};

class TimedDrawing {
 public:
  explicit TimedDrawing(std::unique_ptr<DrawAllPeer> peer) : peer_(std::move(peer)) { track.name = "draw all"; }
  // The maps over the bound of the step that was just taken, one for each target.
  void take(const StepDump& dump, bool keep) {
    const double begin_ms = now_ms();
    peer_->take(std::span(dump.plan.requests).first(dump.plan.now.first_sight), depths_);
    if (keep) track.total_ms.push_back(now_ms() - begin_ms);
  }
  Track track;

 private:
  std::unique_ptr<DrawAllPeer> peer_;
  std::vector<std::vector<float>> depths_;
};

template <typename T>
T must(Result<T> result) {
  if (!result) std::fprintf(stderr, "%s\n", to_string(result.error()).c_str()), std::exit(1);
  return std::move(*result);
}

// The scenario `city` (280 K triangles, two targets).
struct City {
  std::unique_ptr<LoadedScene> loaded = must(LoadedScene::load("city"));
  const Scenario& scenario = *loaded->scenario;
  std::vector<const ExtentTable*> tables;

  City() {
    for (const auto& table : loaded->tables) tables.push_back(table.get());
  }
  std::unique_ptr<ScenarioWorld> make_world() {
    return must(ScenarioWorld::make(scenario, loaded->store, loaded->device));
  }
};

void run_peers(Bench& bench) {
  City city;
  const Scenario& scenario = city.scenario;
  for (const int r : {5, 7, 10, 15, 32}) {
    const auto world = city.make_world();
    const SceneMirror& mirror = world->mirror();
    const TimedScene scene{mirror, world->targets(), city.tables, scenario.lens()};
    std::vector<std::unique_ptr<TimedSteps>> steps, defaults;
    for (const auto& device : bench.devices) {
      steps.push_back(std::make_unique<TimedSteps>(device->kind(), scene, plain_settings(r, r * r * r), *device));
      if (r <= 15)
        defaults.push_back(
            std::make_unique<TimedSteps>(device->kind() + " default", scene, with_defaults(r, r * r * r), *device));
    }
    TimedRays embree("embree rays", make_embree_peer(mirror)), bullet("bullet rays", make_bullet_peer(mirror));
    std::unique_ptr<TimedDrawing> drawing;
    if (bench.devices.size() > 1)
      if (auto peer = make_draw_all_peer(mirror)) drawing = std::make_unique<TimedDrawing>(std::move(*peer));

    const int frames = bench.frames(r > 15 ? 150 : 600), lap = static_cast<int>(scenario.duration_s() * 60);
    for (int frame = 0; frame < frames; ++frame) {
      world->set_time(frame % lap / 60.0);
      for (auto* group : {&steps, &defaults})
        for (auto& contender : *group) {
          if (frame % lap == 0) contender->place(scenario.camera());
          contender->step();
        }
      const StepDump& dump = steps.back()->dump();  // Embree's, which comes last
      const bool keep = frame >= TimedSteps::kWarmUpFrames;
      embree.look(mirror, world->targets(), dump, keep);
      bullet.look(mirror, world->targets(), dump, keep);
      if (drawing) drawing->take(dump, keep);
    }
    for (const auto& contender : steps) bench.tables.row("peers", r, contender->track());
    for (const auto& contender : defaults) bench.tables.row("default", r, contender->track());
    bench.tables.row("peers", r, embree.track);
    bench.tables.row("peers", r, bullet.track);
    bench.tables.ratio("peers", r, steps.back()->track(), embree.track);
    bench.tables.ratio("peers", r, steps.back()->track(), bullet.track);
    if (!drawing) continue;
    bench.tables.row("peers", r, drawing->track);
    bench.tables.ratio("peers", r, steps.front()->track(), drawing->track);
  }
}

using NamedSettings = std::vector<std::pair<std::string, StepSettings>>;

// Contenders over one grid city: every setting with every device.
class GridRun {
 public:
  GridRun(const Bench& bench, const GridCityOptions& options, const NamedSettings& settings, bool with_egl)
      : city_(options), scene_{city_.mirror(), city_.targets(), city_.tables(), {}} {
    for (const auto& device : bench.devices) {
      if (device->kind() == "egl" && !with_egl) continue;
      for (const auto& [name, each] : settings)
        steps_.push_back(
            std::make_unique<TimedSteps>(device->kind() + (name.empty() ? "" : " " + name), scene_, each, *device));
    }
    for (auto& contender : steps_) contender->place(city_.camera());
  }
  void advance(int frames) {
    for (const int end = frame_ + frames; frame_ < end; ++frame_) {
      const double scene_ms = city_.advance(frame_);
      for (auto& contender : steps_) contender->step(scene_ms);
    }
  }
  void describe(const std::string& section, double x) const {
    std::printf("%s %.0f: %zu triangles, %zu instances\n", section.c_str(), x, city_.triangles(),
                city_.mirror().size());
  }
  void write(Bench& bench, const std::string& section, double x) const {
    for (const auto& contender : steps_) bench.tables.row(section, x, contender->track());
  }
  void write_against(Bench& bench, const GridRun& least, const std::string& section, double x) const {
    for (size_t i = 0; i < steps_.size(); ++i)
      bench.tables.ratio(section, x, least.steps_[i]->track(), steps_[i]->track());
  }

 private:
  GridCity city_;
  const TimedScene scene_;
  std::vector<std::unique_ptr<TimedSteps>> steps_;
  int frame_ = 0;
};

// `cities`: the smallest first. Each larger one is measured in turn with the smallest, some frames of one and then as
// many of the other. A change of the machine's speed then affects both, and for most frames the caches hold only one
// city.
void run_growth(Bench& bench, const std::string& section,
                const std::vector<std::pair<double, GridCityOptions>>& cities) {
  constexpr int kTurn = 20;
  const NamedSettings settings = {{"", plain_settings(7, 343)}, {"default", with_defaults(7, 343)}};
  const int frames = bench.frames(300);
  for (const auto& [x, options] : cities) {
    GridRun least(bench, cities.front().second, settings, true);
    if (x == cities.front().first) {
      least.describe(section, x);
      least.advance(frames);
      least.write(bench, section, x);
      continue;
    }
    GridRun larger(bench, options, settings, true);
    larger.describe(section, x);
    for (int done = 0; done < frames; done += kTurn) {
      least.advance(std::min(kTurn, frames - done));
      larger.advance(std::min(kTurn, frames - done));
    }
    larger.write(bench, section, x);
    larger.write_against(bench, least, section, x);
  }
}

// The same steps without other contenders, so that the caches hold only the step's own data.
void run_alone(Bench& bench) {
  City city;
  const Scenario& scenario = city.scenario;
  for (const int r : {5, 7, 10, 15})
    for (const auto& device : bench.devices) {
      const auto world = city.make_world();
      TimedSteps steps(device->kind(), {world->mirror(), world->targets(), city.tables, scenario.lens()},
                       plain_settings(r, r * r * r), *device);
      steps.place(scenario.camera());
      const int frames = std::min(bench.frames(1100), static_cast<int>(scenario.duration_s() * 60));
      for (int frame = 0; frame < frames; ++frame) {
        world->set_time(frame / 60.0);
        steps.step();
      }
      bench.tables.row("alone", r, steps.track());
    }
}

void run_wide(Bench& bench) {
  GridRun run(bench, {.targets = 8}, {{"8 points", plain_settings(16, 4096, 8)}, {"default", with_defaults(16, 4096)}},
              false);
  run.advance(bench.frames(300));
  run.write(bench, "wide", 4096);
}

// The same blocks in increasing detail.
void run_detail(Bench& bench) {
  std::vector<std::pair<double, GridCityOptions>> cities;
  for (const int cells : {2, 7, 22, 70})
    if (!bench.quick || cells < 70)
      cities.push_back({12.0 * 22 * 22 * cells * cells, {.blocks_a_side = 22, .cells = cells}});
  run_growth(bench, "detail", cities);
}

// The same detail with an increasing number of blocks.
void run_blocks(Bench& bench) {
  std::vector<std::pair<double, GridCityOptions>> cities;
  for (const int side : {6, 20, 60, 192})
    if (!bench.quick || side < 192)
      cities.push_back({12.0 * 64 * side * side, {.blocks_a_side = side, .own_geometry = false}});
  run_growth(bench, "blocks", cities);
}

// The same people walk, and an increasing number of them are targets.
void run_targets(Bench& bench) {
  std::vector<std::pair<double, GridCityOptions>> cities;
  for (const int targets : {1, 2, 4, 8, 16, 32})
    cities.push_back({static_cast<double>(targets), {.targets = targets, .group = kMaxTargets}});
  run_growth(bench, "targets", cities);
}

// 10,000 instances, of which an increasing number move.
void run_movers(Bench& bench) {
  std::vector<std::pair<double, GridCityOptions>> cities;
  for (const int movers : {0, 10, 100, 1000})
    cities.push_back({static_cast<double>(movers), {.movers = movers, .props = 10'000 - 400 - 2 - movers}});
  run_growth(bench, "movers", cities);
}

struct Section {
  const char* name;
  void (*run)(Bench&);
};
constexpr Section kSections[] = {{"peers", run_peers},   {"alone", run_alone},   {"wide", run_wide},
                                 {"detail", run_detail}, {"blocks", run_blocks}, {"targets", run_targets},
                                 {"movers", run_movers}};

int run(int argc, char** argv) {
  Bench bench;
  std::string folder;
  std::vector<std::string> wanted;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--quick")
      bench.quick = true;
    else if (word == "--out" && i + 1 < argc)
      folder = argv[++i];
    else if (word == "--section" && i + 1 < argc)
      wanted.push_back(argv[++i]);
    else
      return std::fprintf(stderr, "usage: speed_bench --out FOLDER [--quick] [--section NAME]...\n"), 2;
  }
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (folder.empty() || !bench.tables.open(folder))
    return std::fprintf(stderr, "cannot write into '%s'\n", folder.c_str()), 1;
  prepare_software_rendering();
  std::string no_egl;
  bench.devices = timed_samplers(&no_egl);
  if (!no_egl.empty()) std::fprintf(stderr, "EGL rows left out: %s\n", no_egl.c_str());
  for (const auto& device : bench.devices) std::printf("%s: %s\n", device->kind().c_str(), device->renderer().c_str());
  for (const Section& section : kSections)
    if (wanted.empty() || std::find(wanted.begin(), wanted.end(), section.name) != wanted.end()) section.run(bench);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  return sightline::bench::run(argc, argv);
}
