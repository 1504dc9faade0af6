// Balls that replace missing scenes and meshes, so that a recording can still be shown.
#pragma once

#include <string>
#include <unordered_map>
#include <vector>

#include "client/recordings/scene_files.h"
#include "server/session/convention.h"

namespace sightline {

// Rewrites the messages of a session so that they can be applied. Scenes and meshes that are found are named by hash. A
// missing mesh becomes a ball. A missing scene leaves balls for its bound nodes, and nothing for the others.
class Placeholders {
 public:
  // Both must outlive it. `scenes` must know where to bring files.
  Placeholders(SceneFiles& scenes, const Convention& convention) : scenes_(scenes), convention_(convention) {}

  // `without_scene`: the scene is left out even when its file is there.
  void replace(v1::OpenSession& open, bool without_scene);
  void replace(v1::Tick& tick);

  // The missing files with the reasons, each once.
  const std::vector<std::string>& missed() const { return missed_; }

 private:
  void replace(v1::NewInstance& instance);
  bool find(v1::NewInstance& instance);
  bool find_scene(v1::OpenSession& open);
  v1::Shape ball() const;

  SceneFiles& scenes_;
  const Convention& convention_;
  bool without_scene_ = false;
  std::unordered_map<std::string, bool> lacks_;  // missing or not, by name or hash
  std::vector<std::string> missed_;
};

inline constexpr double kPlaceholderRadiusM = 0.3;

}  // namespace sightline
