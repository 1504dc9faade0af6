// A scenario as a scene that can be looked at: the reference that a run is judged against and its pictures
// are made from. Embree only: it shares no code with the samplers' renders and none with the camera's own
// collision sweep.
#pragma once

#include <memory>
#include <vector>

#include "client/scenario/scenario.h"
#include "server/sample/embree_scene.h"
#include "server/scene/mirror.h"
#include "server/scene/target.h"

namespace sightline {

// Single-threaded; several worlds may share one device, one store and one scenario across threads. All three
// must outlive it.
class ScenarioWorld {
 public:
  static Result<std::unique_ptr<ScenarioWorld>> make(const Scenario& scenario, GeometryStore& store,
                                                     EmbreeDevice& device);

  // Moves all actors to where they are at `time_s`.
  void set_time(double time_s);

  const Scenario& scenario() const { return scenario_; }
  const SceneMirror& mirror() const { return mirror_; }
  const EmbreeScene& occluders() const { return occluders_; }
  const EmbreeScene& colliders() const { return colliders_; }
  // The scenario's targets with a weight above 0, as a session has them.
  const std::vector<Target>& targets() const { return targets_; }
  // The weighted mean of the targets' aim points now, world, metres. There must be a target.
  glm::dvec3 targets_center_m() const;

 private:
  ScenarioWorld(const Scenario& scenario, EmbreeDevice& device);

  const Scenario& scenario_;
  SceneMirror mirror_;
  EmbreeScene occluders_, colliders_;
  std::vector<Target> targets_;
};

// Centre of the target's bounding box in the world: what it is aimed at by default.
glm::dvec3 aim_point_m(const Instance& target);

}  // namespace sightline
