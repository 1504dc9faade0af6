#include "client/replay/truth.h"

#include <algorithm>
#include <future>

#include "client/truth/metrics.h"

namespace sightline {
namespace {

bool same_view(const CameraFrame& a, const CameraFrame& b) {
  return a.camera.position_m == b.camera.position_m && a.camera.rotation == b.camera.rotation &&
         a.lens.vertical_fov_rad == b.lens.vertical_fov_rad;
}

}  // namespace

CameraLimits wider(const CameraLimits& a, const CameraLimits& b) {
  return {
      .max_speed_mps = std::max(a.max_speed_mps, b.max_speed_mps),
      .max_acceleration_mps2 = std::max(a.max_acceleration_mps2, b.max_acceleration_mps2),
      .max_angular_speed_radps = std::max(a.max_angular_speed_radps, b.max_angular_speed_radps),
      .max_angular_acceleration_radps2 = std::max(a.max_angular_acceleration_radps2, b.max_angular_acceleration_radps2),
      .body_radius_m = std::min(a.body_radius_m, b.body_radius_m)};
}

ReplayTruth::ReplayTruth(size_t picture_every)
    : picture_every_(picture_every),
      occluders_(device_, EmbreeScene::Content::kOccluders),
      colliders_(device_, EmbreeScene::Content::kColliders) {}

void ReplayTruth::add(const Session& session, const CameraLimits& recorded_limits, const v1::CameraReply& recorded,
                      const v1::CameraReply& replayed) {
  const bool first = recorded_.frames.empty();
  recorded_.limits = recorded_limits;
  replayed_.limits = first ? session.limits() : wider(replayed_.limits, session.limits());
  std::vector<Target> targets;
  for (const Target& target : session.targets()) {
    if (!(target.weight > 0)) continue;
    targets.push_back(target);
    names_.try_emplace(target.instance_id, std::to_string(target.instance_id));
  }
  const bool pictured = recorded_.frames.size() % picture_every_ == 0 && !targets.empty();
  const int size = pictured ? kTruthSize : 0;
  pictures_ += pictured;
  colliders_.take_in(session.mirror());
  if (pictured) occluders_.take_in(session.mirror());
  const JudgedScene scene{session.mirror(), targets, occluders_, colliders_};
  const CameraFrame was = frame_of(recorded, session.convention(), session.lens());
  const CameraFrame is = frame_of(replayed, session.convention(), session.lens());
  if (same_view(was, is) && (recorded_.frames.empty() || same_view(recorded_.frames.back(), replayed_.frames.back()))) {
    judge_into(recorded_, scene, was, size);
    replayed_.frames.push_back(is);
    replayed_.truths.push_back(recorded_.truths.back());
    return;
  }
  auto other = std::async(pictured ? std::launch::async : std::launch::deferred,
                          [&] { judge_into(recorded_, scene, was, size); });
  judge_into(replayed_, scene, is, size);
  other.get();
}

void ReplayTruth::judge_into(Run& run, const JudgedScene& scene, const CameraFrame& frame, int picture_size) const {
  const CameraFrame& before = run.frames.empty() || frame.jump ? frame : run.frames.back();
  FrameTruth truth = judge_frame(scene, before.camera.position_m, frame, picture_size);
  run.frames.push_back(frame);
  run.truths.push_back(std::move(truth));
}

RunMetrics ReplayTruth::metrics_of(const Run& run) const {
  std::vector<TargetMetrics> targets;
  for (const auto& [id, name] : names_) targets.push_back({.id = id, .name = name});
  return summarize(std::move(targets), run.frames, run.truths, run.limits);
}

std::vector<FigureRow> ReplayTruth::rows() const {
  return truth_rows(metrics_of(recorded_), metrics_of(replayed_));
}

}  // namespace sightline
