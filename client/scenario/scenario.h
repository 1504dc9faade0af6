// A scenario: a glTF file whose nodes have roles. Node extras hold the roles (scenes/README.md has the table):
//
//   "extras": {"sightline": {"role": "target", "weight": 1.0, "required": true}}    role: target | occluder | camera
//
// A target may be one for a part of the time only: "during": [[0, 4], [12, 16]], in seconds.
//
// A target or occluder is a node that moves with the file's first animation. The camera node is where the camera
// starts; a glTF camera on it defines the lens. All other nodes stand still.
//
// Frame: glTF's (the canonical one), metres, seconds. Immutable; any number of threads may play it.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/base/camera.h"
#include "server/base/error.h"
#include "server/scene/asset.h"
#include "server/scene/geometry.h"

namespace sightline {

// [from_s, to_s).
struct TimeSpan {
  double from_s = 0.0, to_s = 0.0;
};

struct ScenarioActor {
  uint64_t id = 0;         // 1, 2, ... in the order of the file's nodes: what the node is bound to
  int node = -1;           // index into the asset's nodes
  std::string name;        // the node's name, unique in the file
  bool is_target = false;  // else an occluder
  double weight = 1.0;
  bool required = true;
  std::vector<TimeSpan> during = {};  // when it is a target, in the order of time; empty: always

  // A target at this time, with a weight above 0.
  bool is_target_at(double time_s) const;
};

// The motion of one actor at one time. The pose has no scale, as in a NodeBinding.
struct ActorMotion {
  Pose pose;
  glm::dvec3 velocity_mps{0.0};
};

class Scenario {
 public:
  // Errors name the node: field "nodes[Guard].extras.sightline.role". kInvalidArgument: an unknown role, no camera, or
  // more than one. Also a role on a node whose name is missing or not unique, and a weight that is not a number >= 0.
  // With "during": spans of time that are not in order, and a time at which no node is a target.
  static Result<Scenario> from_asset(std::shared_ptr<const SceneAsset> asset);
  // Reads the file first.
  static Result<Scenario> read(const std::string& path, GeometryStore& store);

  const SceneAsset& asset() const { return *asset_; }
  const std::vector<ScenarioActor>& actors() const { return actors_; }
  std::vector<ScenarioActor> targets() const;  // all that are targets at some time
  // When other nodes become the targets, in (0, duration_s()], increasing. Empty: they are the same all the time.
  const std::vector<double>& target_changes_s() const { return target_changes_s_; }
  // True if they do in (after_s, until_s].
  bool targets_change(double after_s, double until_s) const;
  // The length of the first animation; 0 when there is none.
  double duration_s() const;
  // The camera's start and its lens (design 2: 40 degrees and 16:9 unless the file says otherwise).
  const Pose& camera() const { return camera_; }
  const Lens& lens() const { return lens_; }

  // The poses of all actors at `time_s`, in the order of actors(). They are constant before the first key and after the
  // last.
  std::vector<Pose> poses_at(double time_s) const;
  // The same with velocities, by central difference over `step_s` (> 0), clipped to the animation.
  std::vector<ActorMotion> motion_at(double time_s, double step_s) const;

 private:
  Scenario() = default;
  Status take_roles();
  Status take_role(int node);
  Status take_actor(int node, const std::string& role, ScenarioActor actor);
  Status find_target_changes();
  Status take_camera(int node);
  void take_lens(const AssetCamera& camera);
  void remember_rest();

  std::shared_ptr<const SceneAsset> asset_;
  std::vector<ScenarioActor> actors_;
  std::vector<double> target_changes_s_;
  int camera_node_ = -1;
  Pose camera_;
  Lens lens_;
  std::vector<glm::dmat3> node_from_rest_;  // by actor: inverse of the linear part at rest
  std::vector<glm::dquat> rest_rotations_;  // by actor
};

// True if a node names a role.
bool has_roles(const SceneAsset& asset);

}  // namespace sightline
