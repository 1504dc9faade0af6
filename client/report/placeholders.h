// Balls in the place of what a recording names and nobody has any more, so that a session can still be played.
#pragma once

#include <string>
#include <unordered_map>
#include <vector>

#include "client/recordings/scene_files.h"
#include "server/session/convention.h"

namespace sightline {

// Rewrites the messages of a session so that they can be played. Scenes and meshes that are found are named by hash; a
// scene that is not leaves balls where its bound nodes were, and nothing where its other nodes were; a mesh that is not
// is a ball.
class Placeholders {
 public:
  // Both must outlive it; `scenes` knows where to bring files.
  Placeholders(SceneFiles& scenes, const Convention& convention) : scenes_(scenes), convention_(convention) {}

  // `without_scene`: the scene is left out, though its file may be there.
  void replace(v1::OpenSession& open, bool without_scene);
  void replace(v1::Tick& tick);

  // What was not found and why, each once.
  const std::vector<std::string>& missed() const { return missed_; }

 private:
  void replace(v1::NewInstance& instance);
  bool find(v1::NewInstance& instance);
  bool find_scene(v1::OpenSession& open);
  v1::Shape ball() const;

  SceneFiles& scenes_;
  const Convention& convention_;
  bool without_scene_ = false;
  std::unordered_map<std::string, bool> lacks_;  // by name or hash
  std::vector<std::string> missed_;
};

inline constexpr double kPlaceholderRadiusM = 0.3;

}  // namespace sightline
