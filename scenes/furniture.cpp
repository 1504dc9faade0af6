#include "scenes/furniture.h"

#include <algorithm>
#include <cmath>

#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

constexpr double kFreeWay_m = 0.7;  // between furniture and the targets' axes

struct Kind {
  const char* name;
  glm::dvec3 size_m;
};
constexpr std::array<Kind, 3> kKinds{
    {{"table", {1.25, 0.75, 0.75}}, {"shelf", {1.0, 2.0, 0.375}}, {"sofa", {1.75, 0.875, 0.875}}}};

double distance_m(const FloorArea& piece, const glm::dvec2& p) {
  const double dx = std::abs(p.x - piece.middle_m.x) - piece.half_m.x,
               dz = std::abs(p.y - piece.middle_m.y) - piece.half_m.y;
  return length({std::max(dx, 0.0), std::max(dz, 0.0)});
}

bool is_clear(const FloorArea& piece, const std::vector<glm::dvec2>& kept_free_m) {
  return std::all_of(kept_free_m.begin(), kept_free_m.end(),
                     [&](const glm::dvec2& p) { return distance_m(piece, p) >= kFreeWay_m; });
}

}  // namespace

Furniture::Furniture(ScenarioBuilder& scene) : scene_(scene) {
  for (size_t k = 0; k < kKinds.size(); ++k) {
    const glm::dvec3& s = kKinds[k].size_m;
    meshes_[k] = scene.add_mesh(kKinds[k].name, standing_box(s.x, s.y, s.z), colors::kWood);
  }
}

void Furniture::try_piece(const FloorArea& area, const std::vector<glm::dvec2>& kept_free_m, CounterRandom& random) {
  const size_t kind = random.next_below(kKinds.size());
  const int turn = static_cast<int>(random.next_below(2));
  const glm::dvec3& size = kKinds[kind].size_m;
  const glm::dvec2 half = turn == 0 ? glm::dvec2(size.x, size.z) / 2.0 : glm::dvec2(size.z, size.x) / 2.0;
  const glm::dvec2 room = area.half_m - half;
  const double dx = snapped_in(random, -room.x, room.x);
  const double dz = snapped_in(random, -room.y, room.y);
  const FloorArea piece{area.middle_m + glm::dvec2(dx, dz), half};
  if (!is_clear(piece, kept_free_m)) return;
  scene_.add_static(numbered(kKinds[kind].name, ++count_), meshes_[kind], {piece.middle_m.x, 0, piece.middle_m.y},
                    quarter_turns(turn));
}

}  // namespace sightline::scenes
