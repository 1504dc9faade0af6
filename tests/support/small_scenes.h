// Small scenes made of boxes and people, for tests that know what a camera must see there.
#pragma once

#include <memory>

#include "client/scenario/scenario_world.h"
#include "scenes/scenario_builder.h"
#include "scenes/shapes.h"
#include "server/sample/extent.h"
#include "server/scene/gltf.h"

namespace sightline::test {

inline scenes::Motion still(const glm::dvec3& place_m, double duration_s) {
  scenes::Motion motion;
  for (const double time_s : {0.0, duration_s}) motion.add(time_s, place_m, {1, 0, 0, 0});
  return motion;
}

// A floor, a camera, and what a test adds.
class SmallScene {
 public:
  SmallScene(double duration_s, const glm::dvec3& eye_m, const glm::dvec3& at_m = {0, 1, 0})
      : duration_s_(duration_s), builder_(duration_s) {
    builder_.add_camera(eye_m, at_m);
    box("floor", {40, 0.25, 40}, {0, -0.25, 0});
  }
  SmallScene& box(const std::string& name, const glm::dvec3& size_m, const glm::dvec3& foot_m) {
    const int mesh = builder_.add_mesh(name, scenes::standing_box(size_m.x, size_m.y, size_m.z), {1, 1, 1});
    builder_.add_static(name, mesh, foot_m);
    return *this;
  }
  SmallScene& target(const std::string& name, const glm::dvec3& place_m) {
    builder_.add_character(name, still(place_m, duration_s_));
    return *this;
  }
  SmallScene& walker(const std::string& name, const scenes::Motion& motion) {
    builder_.add_character(name, motion);
    return *this;
  }
  SmallScene& mover(const std::string& name, const glm::dvec3& size_m, const scenes::Motion& motion) {
    const int mesh = builder_.add_mesh(name, scenes::standing_box(size_m.x, size_m.y, size_m.z), {1, 1, 1});
    builder_.add_occluder(name, mesh, motion, {});
    return *this;
  }
  // Walls and a ceiling 3 m high round the middle, 4 x 4 m inside; the wall towards +z has a doorway 1.5 m wide if
  // asked for.
  SmallScene& closed_box(bool doorway) {
    box("west", {0.25, 3, 4.5}, {-2.125, 0, 0}).box("east", {0.25, 3, 4.5}, {2.125, 0, 0});
    box("north", {4, 3, 0.25}, {0, 0, -2.125}).box("ceiling", {4.5, 0.25, 4.5}, {0, 3, 0});
    if (!doorway) return box("south", {4, 3, 0.25}, {0, 0, 2.125});
    return box("south-west", {1.25, 3, 0.25}, {-1.375, 0, 2.125}).box("south-east", {1.25, 3, 0.25}, {1.375, 0, 2.125});
  }
  std::vector<std::byte> write() const { return builder_.write(); }

 private:
  const double duration_s_;
  scenes::ScenarioBuilder builder_;
};

struct Place {
  GeometryStore store;
  EmbreeDevice device;
  ExtentCache extents;
  Scenario scenario;

  explicit Place(const SmallScene& scene) : Place(scene.write()) {}
  explicit Place(const std::vector<std::byte>& glb)
      : scenario(*Scenario::from_asset(*read_gltf(glb, nullptr, store))) {}
  std::unique_ptr<ScenarioWorld> world() { return *ScenarioWorld::make(scenario, store, device); }
};

}  // namespace sightline::test
