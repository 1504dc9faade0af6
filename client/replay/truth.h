// Judges what the recorded and the replayed camera of one session truly saw and touched, in the same mirror.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "client/report/figures.h"
#include "client/truth/judge.h"
#include "server/sample/embree_scene.h"
#include "server/session/session.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Limits that allow what either of two allows.
CameraLimits wider(const CameraLimits& a, const CameraLimits& b);

// Not thread-safe. The pictures of the two cameras are rendered in parallel.
class ReplayTruth {
 public:
  // `picture_every` >= 1: a picture of 512 x 512 is judged at every n-th step; collisions at every step.
  explicit ReplayTruth(size_t picture_every);

  // Both replies must answer the newest tick of `session`, which must be the same at every call. `recorded_limits`: of
  // the recorded run, which is judged by its own limits and not by those of the replay.
  void add(const Session& session, const CameraLimits& recorded_limits, const v1::CameraReply& recorded,
           const v1::CameraReply& replayed);
  size_t pictures() const { return pictures_; }
  // One column for the recorded run, one for the replayed run.
  std::vector<FigureRow> rows() const;

 private:
  struct Run {
    std::vector<CameraFrame> frames;
    std::vector<FrameTruth> truths;
    CameraLimits limits;  // the widest at any time
  };
  void judge_into(Run& run, const JudgedScene& scene, const CameraFrame& frame, int picture_size) const;
  RunMetrics metrics_of(const Run& run) const;

  const size_t picture_every_;
  EmbreeDevice device_;
  EmbreeScene occluders_, colliders_;
  Run recorded_, replayed_;
  std::map<uint64_t, std::string> names_;  // of every target so far
  size_t pictures_ = 0;
};

}  // namespace sightline
