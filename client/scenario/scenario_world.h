// A scenario as a scene that rays can be traced through: runs are judged against it, and pictures are made from it. It
// uses only Embree, and shares no code with the samplers or with the camera's own collision sweep.
#pragma once

#include <memory>
#include <vector>

#include "client/scenario/scenario.h"
#include "server/sample/embree_scene.h"
#include "server/scene/mirror.h"
#include "server/scene/target.h"

namespace sightline {

// Not thread-safe, but worlds on several threads may share one device, one store and one scenario. All three must
// outlive it.
class ScenarioWorld {
 public:
  static Result<std::unique_ptr<ScenarioWorld>> make(const Scenario& scenario, GeometryStore& store,
                                                     EmbreeDevice& device);

  // Moves all actors to their poses at `time_s`, and takes the targets of that time.
  void set_time(double time_s);

  const Scenario& scenario() const { return scenario_; }
  const SceneMirror& mirror() const { return mirror_; }
  const EmbreeScene& occluders() const { return occluders_; }
  const EmbreeScene& colliders() const { return colliders_; }
  // The scenario's targets at the present time, with a weight above 0, as a session has them.
  const std::vector<Target>& targets() const { return targets_; }
  // The weighted mean of the targets' aim points at the present time; world, metres. There must be a target.
  glm::dvec3 targets_center_m() const;
  // True if anything but the target itself lies between a position (world) and the target's aim point.
  bool is_aim_hidden(const Target& target, const glm::dvec3& from_m) const;

 private:
  ScenarioWorld(const Scenario& scenario, EmbreeDevice& device);

  const Scenario& scenario_;
  SceneMirror mirror_;
  EmbreeScene occluders_, colliders_;
  std::vector<Target> targets_;
};

// The scenario's targets at a time, with a weight above 0.
std::vector<Target> targets_at(const Scenario& scenario, double time_s);

// The centre of the target's bounding box in the world, which is the default aim point.
glm::dvec3 aim_point_m(const Instance& target);

}  // namespace sightline
