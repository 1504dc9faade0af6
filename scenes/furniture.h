// Tables, shelves and sofas in rooms.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <vector>

#include "scenes/exact.h"
#include "scenes/scenario_builder.h"

namespace sightline::scenes {

// A rectangle on the floor, seen from above: x, z in metres.
struct FloorArea {
  glm::dvec2 middle_m{0.0};
  glm::dvec2 half_m{0.0};
};

class Furniture {
 public:
  // Adds the meshes to `scene`, which must outlive the object.
  explicit Furniture(ScenarioBuilder& scene);

  // Chooses a piece and a place for it by chance. The piece stands wholly within `area`. It is left out if it would be
  // nearer than 0.7 m to one of the places that are kept free.
  void try_piece(const FloorArea& area, const std::vector<glm::dvec2>& kept_free_m, CounterRandom& random);

 private:
  ScenarioBuilder& scene_;
  std::array<int, 3> meshes_{};
  int count_ = 0;
};

}  // namespace sightline::scenes
