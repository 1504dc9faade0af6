#include "tests/drive/drive_support.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "client/page/contact_sheet.h"
#include "client/scenario/scenario_session.h"
#include "client/truth/follow.h"
#include "server/scene/gltf.h"

namespace sightline::test {
namespace {

using namespace std::chrono_literals;

Result<std::vector<PlayedFrame>> play_on(const std::string& address, std::span<const std::byte> glb,
                                         const Scenario& scenario, const v1::Settings& settings,
                                         const PlayOptions& options) {
  auto client = Client::connect(address, 10s);
  if (!client) return tl::unexpected(client.error());
  const auto scene = client->upload_scene(glb, 60s);
  if (!scene) return tl::unexpected(scene.error());
  v1::OpenSession open = open_request(scenario, scene->hash(), 1);
  *open.mutable_settings() = settings;
  auto session = client->open_session(open, 60s);
  if (!session) return tl::unexpected(session.error());
  return play(scenario, **session, options);
}

// Checks the data on which every judgement relies.
struct Reference {
  GeometryStore store;
  EmbreeDevice device;
  std::optional<Scenario> scenario;
  std::unique_ptr<ScenarioWorld> world;

  explicit Reference(std::span<const std::byte> glb) {
    const auto asset = read_gltf(glb, nullptr, store);
    if (!asset) throw std::runtime_error(to_string(asset.error()));
    auto read = Scenario::from_asset(*asset);
    if (!read) throw std::runtime_error(to_string(read.error()));
    scenario.emplace(std::move(*read));
    auto made = ScenarioWorld::make(*scenario, store, device);
    if (!made) throw std::runtime_error(to_string(made.error()));
    world = std::move(*made);
  }
  RunMetrics judge_path(std::span<const CameraFrame> path, int picture_every, std::vector<FrameTruth>& truths) {
    JudgeOptions options;
    options.picture_every = picture_every;
    options.picture_size = kTruthSize / 2;
    options.threads = 2;
    truths = *judge(*scenario, store, device, path, options);
    return summarize(*scenario, path, truths, CameraLimits{});
  }
};

std::vector<PlayedFrame> play_or_fail(const std::string& address, std::span<const std::byte> glb,
                                      const Scenario& scenario, const DriveTestOptions& options) {
  PlayOptions play_options;
  play_options.rate_hz = options.rate_hz;
  play_options.duration_s = options.duration_s > 0 ? options.duration_s : scenario.duration_s();
  play_options.lockstep = true;
  auto frames = play_on(address, glb, scenario, options.settings, play_options);
  if (frames) return std::move(*frames);
  ADD_FAILURE() << to_string(frames.error());
  return {};
}

}  // namespace

std::vector<PlayedFrame> play_only(const std::string& address, std::span<const std::byte> glb,
                                   const DriveTestOptions& options) {
  return play_or_fail(address, glb, *Reference(glb).scenario, options);
}

Driven drive(const std::string& address, std::span<const std::byte> glb, const DriveTestOptions& options) {
  Reference reference(glb);
  Driven driven;
  driven.frames = play_or_fail(address, glb, *reference.scenario, options);
  if (driven.frames.empty()) return driven;
  for (const PlayedFrame& played : driven.frames) driven.path.push_back(played.frame);
  driven.run = reference.judge_path(driven.path, options.picture_every, driven.truths);
  std::vector<FrameTruth> unused;
  driven.follow = reference.judge_path(follow_path(*reference.world, driven.path), options.picture_every, unused);
  return driven;
}

void keep_picture(const std::string& name, std::span<const std::byte> glb, const Driven& driven) {
  const char* folder = std::getenv("SIGHTLINE_TEST_PICTURES");
  if (!folder || driven.path.empty()) return;
  Reference reference(glb);
  const Status written = write_png(contact_sheet(*reference.world, driven.path),
                                   std::string(folder) + "/" + name + ".png");
  EXPECT_TRUE(written) << to_string(written.error());
}

}  // namespace sightline::test
