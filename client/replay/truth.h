// What two cameras over one session really saw and touched: the recorded one and the replayed one, in the same mirror.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "client/truth/judge.h"
#include "client/drive/report.h"
#include "server/sample/embree_scene.h"
#include "server/session/session.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Not thread-safe; pictures of the two cameras are taken at the same time.
class ReplayTruth {
 public:
  // `picture_every` >= 1: of every n-th step a picture of 512 x 512 is judged; bodies at every step.
  explicit ReplayTruth(size_t picture_every);

  // Both replies are of the newest tick that `session` was told; always the same session.
  void add(const Session& session, const v1::CameraReply& recorded, const v1::CameraReply& replayed);
  size_t pictures() const { return pictures_; }
  // Recorded, replayed.
  std::vector<FigureRow> rows() const;

 private:
  struct Run {
    std::vector<CameraFrame> frames;
    std::vector<FrameTruth> truths;
  };
  void judge_into(Run& run, const JudgedScene& scene, const CameraFrame& frame, int picture_size) const;
  RunMetrics metrics_of(const Run& run) const;

  const size_t picture_every_;
  EmbreeDevice device_;
  EmbreeScene occluders_, colliders_;
  Run recorded_, replayed_;
  std::map<uint64_t, std::string> names_;  // of all that were targets
  CameraLimits limits_;                    // the widest that held at any time
  size_t pictures_ = 0;
};

}  // namespace sightline
