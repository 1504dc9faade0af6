// Random scenes for the samplers' tests: primitive shapes under random transforms, layers, opacities and hiding, and
// random off-axis map requests. Everything is a pure function of the seed.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "server/base/random.h"
#include "server/sample/depth_map.h"
#include "server/scene/mirror.h"
#include "server/scene/primitives.h"

namespace sightline::test {

class SceneMaker {
 public:
  // Everything is placed around `origin_m`.
  explicit SceneMaker(uint64_t seed, const glm::dvec3& origin_m = glm::dvec3(0.0))
      : random_(seed, 0, RandomPurpose::kTest), origin_m_(origin_m) {}

  CounterRandom& random() { return random_; }

  std::shared_ptr<const Geometry> shape();
  Pose pose();
  glm::dmat3 linear();  // a scale, sometimes with shear or mirroring
  InstanceAttributes attributes();
  NewInstance instance(uint64_t id);
  // `count` instances with ids from 1.
  SceneDelta scene(uint32_t count);
  // From a position in or around the scene towards its middle: off-axis windows, 5 to 32 texels a side, jittered.
  MapView view();
  // Some slots below `slot_count`, ascending.
  std::vector<uint32_t> ignored(size_t slot_count);
  // New poses for about half of the instances that `mirror` knows by the ids 1..count.
  TransformUpdate moves(const SceneMirror& mirror, uint32_t count);

 private:
  glm::dvec3 in_cube(double half_size_m);
  CounterRandom random_;
  const glm::dvec3 origin_m_;
};

}  // namespace sightline::test
