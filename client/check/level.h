// A level file as a session of the daemon would have it, at rest: read, instantiated and mirrored by the same code.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "client/scenario/scenario.h"
#include "server/scene/asset.h"
#include "server/scene/mirror.h"

namespace sightline {

struct Level {
  std::unique_ptr<GeometryStore> store;
  std::shared_ptr<const SceneAsset> asset;
  // Slot k holds the k-th instance that the file makes. Those of `actors` come first.
  std::unique_ptr<SceneMirror> mirror;
  std::vector<ScenarioActor> actors;               // targets and occluders; empty without roles
  bool has_camera = false;                         // a node has the role "camera"
  std::vector<std::string> session_warnings;       // what SessionOpened.warnings says besides the reader's
  std::optional<Error> unplayable = std::nullopt;  // why the roles make no scenario

  // True for instances that do not belong to a target or another moving part.
  bool stands(uint32_t slot) const { return slot >= actors.size(); }
  // Of the node that the instance shows.
  const std::string& name_of(uint32_t slot) const;
};

// Fails as read_gltf_file, instantiate and SceneMirror::apply do.
Result<Level> read_level(const std::string& path);

}  // namespace sightline
