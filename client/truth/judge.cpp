#include "client/truth/judge.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <thread>

namespace sightline {
namespace {

// In picture heights from the middle of the picture; none when the position is outside of it.
std::optional<glm::dvec2> point_in_picture(const CameraFrame& frame, const glm::dvec3& point_m) {
  const glm::dvec3 p = inverse_transform_point(frame.camera, point_m);
  if (p.z >= 0) return std::nullopt;
  const double height = 2 * -p.z * std::tan(frame.lens.vertical_fov_rad / 2);
  const glm::dvec2 at(p.x / height, p.y / height);
  if (std::abs(at.y) > 0.5 || std::abs(at.x) > 0.5 * frame.lens.aspect) return std::nullopt;
  return at;
}

FrameTruth judge_at(ScenarioWorld& world, std::span<const CameraFrame> frames, size_t i, const JudgeOptions& options) {
  const CameraFrame& frame = frames[i];
  const CameraFrame& before = i == 0 || frame.jump ? frame : frames[i - 1];
  world.set_time(frame.time_s);
  const bool picture = options.picture_every > 0 && i % static_cast<size_t>(options.picture_every) == 0;
  FrameTruth truth = judge_frame({world.mirror(), world.targets(), world.occluders(), world.colliders()},
                                 before.camera.position_m, frame, picture ? options.picture_size : 0);
  truth.other_targets = i > 0 && world.scenario().targets_change(frames[i - 1].time_s, frame.time_s);
  return truth;
}

}  // namespace

FrameTruth judge_frame(const JudgedScene& scene, const glm::dvec3& before_m, const CameraFrame& frame,
                       int picture_size) {
  FrameTruth truth;
  truth.body = measure_body(scene.colliders, before_m, frame.camera.position_m);
  for (const Target& target : scene.targets)
    truth.centers.push_back(point_in_picture(frame, scene.mirror.find(target.instance_id)->center_m));
  if (picture_size > 0) {
    truth.picture = measure_picture(scene.occluders, scene.mirror, scene.targets, frame.camera, frame.lens,
                                    picture_size);
    add_outlines(scene.occluders, scene.mirror, scene.targets, frame.camera, frame.lens, *truth.picture);
  }
  return truth;
}

Result<std::vector<FrameTruth>> judge(const Scenario& scenario, GeometryStore& store, EmbreeDevice& device,
                                      std::span<const CameraFrame> frames, const JudgeOptions& options) {
  const size_t thread_count = std::clamp<size_t>(frames.size(), 1, static_cast<size_t>(std::max(1, options.threads)));
  std::vector<std::unique_ptr<ScenarioWorld>> worlds;
  for (size_t k = 0; k < thread_count; ++k) {
    auto world = ScenarioWorld::make(scenario, store, device);
    if (!world) return tl::unexpected(world.error());
    worlds.push_back(std::move(*world));
  }
  std::vector<FrameTruth> truths(frames.size());
  std::mutex mutex;
  size_t done = 0;
  // Frames are interleaved over the threads, so that expensive passages are shared evenly.
  const auto work = [&](size_t k) {
    for (size_t i = k; i < frames.size(); i += thread_count) {
      truths[i] = judge_at(*worlds[k], frames, i, options);
      const std::lock_guard lock(mutex);
      ++done;
      if (options.progress) options.progress(done);
    }
  };
  std::vector<std::jthread> threads;
  for (size_t k = 1; k < thread_count; ++k) threads.emplace_back(work, k);
  work(0);
  threads.clear();  // joins
  return truths;
}

}  // namespace sightline
