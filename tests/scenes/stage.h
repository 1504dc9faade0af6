// A scenario brought to life for a test: its file read by the server's own reader, its instances in a mirror,
// its animation played by hand.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/scene/asset.h"
#include "server/scene/gltf.h"
#include "server/scene/mirror.h"

namespace sightline {

struct Role {
  int node = -1;
  std::string name;
  std::string role;  // "target", "occluder" or "camera"
  uint64_t id = 0;   // of its instance; 0 for the camera
};

class Stage {
 public:
  // Throws std::runtime_error when the reader or the mirror refuses the scenario.
  explicit Stage(std::span<const std::byte> bytes);

  const SceneAsset& asset() const { return *asset_; }
  const AssetAnimation& animation() const { return asset_->animations.at(0); }
  double duration_s() const { return animation().duration_s; }
  const SceneMirror& mirror() const { return mirror_; }
  const std::vector<Role>& roles() const { return roles_; }
  std::vector<Role> with_role(const std::string& role) const;
  // Moves every target and occluder to where it is at `time_s`.
  void play(double time_s);
  Pose pose_of(const Role& role, double time_s) const;
  // Slots of the targets' instances, ascending.
  std::vector<uint32_t> target_slots() const;

 private:
  GeometryStore store_;
  std::shared_ptr<const SceneAsset> asset_;
  std::vector<Role> roles_;
  SceneMirror mirror_;
};

}  // namespace sightline
