// Balls in the place of what a recording names and nobody has any more, so that a session can still be played.
#pragma once

#include <string>
#include <unordered_map>
#include <vector>

#include "client/recorded_scenes.h"
#include "server/session/convention.h"

namespace sightline {

// Rewrites the messages of a session: a scene without a file leaves balls where its bound nodes were, and nothing where
// its other nodes were; a mesh without a file is a ball. What is there stays as it is.
class StandIns {
 public:
  StandIns(RecordedScenes& scenes, const Convention& convention) : scenes_(scenes), convention_(convention) {}

  // `without_scene`: the scene is left out, though its file may be there.
  void replace(v1::OpenSession& open, bool without_scene);
  void replace(v1::Tick& tick);

  // Which files are missed, each once: "hall.glb: no such file".
  const std::vector<std::string>& missed() const { return missed_; }

 private:
  bool lacks(const v1::MeshRef& mesh);
  void replace(v1::NewInstance& instance);
  v1::Shape ball() const;

  RecordedScenes& scenes_;
  const Convention& convention_;
  bool without_scene_ = false;
  std::unordered_map<std::string, bool> lacks_;  // by name or hash
  std::vector<std::string> missed_;
};

inline constexpr double kStandInRadiusM = 0.3;

}  // namespace sightline
