// Where the parts of a level stand: the walls of a plan, floors, ceilings, columns and furniture.
#pragma once

#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "scenes/level_parts.h"
#include "scenes/level_plan.h"
#include "scenes/scenario_builder.h"

namespace sightline::scenes {

// An upright rectangle seen from above, sides along x and z.
struct LevelRectangle {
  glm::dvec2 middle_m;
  glm::dvec2 half_m;
  double distance_m(const glm::dvec2& p) const;
  bool meets(const LevelRectangle& other) const;  // closer than 0.1 m
};

// The places of one storey where nothing may stand in the way: points that keep kFreeWay_m around them free, and
// rectangles.
struct KeptFree {
  std::vector<glm::dvec2> points_m;
  std::vector<LevelRectangle> taken;
  bool allows(const LevelRectangle& piece) const;
};
inline constexpr double kFreeWay_m = 0.75;

class LevelLayout {
 public:
  // `base_m` is the height of the floor's surface in all of these.
  void add_walls(const LevelPlan& plan, double base_m, bool wide_doors, CounterRandom& random);
  // A floor, or the ceiling of the storey that stands on it, without the tiles whose middle is in `hole`.
  void add_slabs(const LevelPlan& plan, Part part, double origin_y_m, const std::vector<LevelRectangle>& holes = {});
  // Pillars on the corners of tiles inside the rooms, where they are allowed. They become taken.
  void add_pillars(const LevelPlan& plan, double base_m, double share, KeptFree& free, CounterRandom& random);
  // Tries this many pieces in each room; a piece that is not allowed is left out.
  void add_furniture(const LevelPlan& plan, double base_m, int tries_per_room, KeptFree& free, CounterRandom& random);
  void add(Part part, const glm::dvec3& position_m, int turns) { pieces_.push_back({part, position_m, turns}); }

  // Adds every piece as a node that stands still.
  void build(ScenarioBuilder& scene, const PartMeshes& meshes) const;

 private:
  struct Piece {
    Part part;
    glm::dvec3 position_m;
    int turns;
  };
  void add_straight(const LevelPlan& plan, const glm::ivec2& at, double base_m, bool wide_doors, CounterRandom& random);
  void add_junction(const LevelPlan& plan, const glm::ivec2& at, double base_m);

  std::vector<Piece> pieces_;
};

// The middles of the open doors of a plan and the points 1 m to both sides, for KeptFree.
std::vector<glm::dvec2> door_points(const LevelPlan& plan);

}  // namespace sightline::scenes
