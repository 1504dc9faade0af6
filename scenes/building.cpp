#include "scenes/building.h"

#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

constexpr double kRecess_m = 0.25;
constexpr double kParapet_m = 0.75;

// A wall seen from the front: `right` runs along it, y up, `inwards` into the building.
struct Facade {
  glm::dvec3 corner_m;  // its lower left
  glm::dvec3 right;
  glm::dvec3 inwards;

  glm::dvec3 at(double along_m, double up_m, double depth_m = 0) const {
    return corner_m + right * along_m + glm::dvec3(0, up_m, 0) + inwards * depth_m;
  }
};

struct Opening {
  double left_m, right_m, sill_m, head_m;
};

// The wall around a window as four trapezoids, the four sides of the recess, and the pane: 18 triangles.
void append_window(MeshData& mesh, const Facade& wall, const Opening& cell, const Opening& hole) {
  const glm::dvec3 outer[] = {wall.at(cell.left_m, cell.sill_m), wall.at(cell.right_m, cell.sill_m),
                              wall.at(cell.right_m, cell.head_m), wall.at(cell.left_m, cell.head_m)};
  glm::dvec3 edge[4], pane[4];
  for (int i = 0; i < 4; ++i) {
    const double along = i == 0 || i == 3 ? hole.left_m : hole.right_m, up = i < 2 ? hole.sill_m : hole.head_m;
    edge[i] = wall.at(along, up);
    pane[i] = wall.at(along, up, kRecess_m);
  }
  for (int i = 0; i < 4; ++i) {
    const int next = (i + 1) % 4;
    append_quad(mesh, outer[i], outer[next], edge[next], edge[i]);
    append_quad(mesh, edge[i], edge[next], pane[next], pane[i]);
  }
  append_quad(mesh, pane[0], pane[1], pane[2], pane[3]);
}

void append_facade(MeshData& mesh, const Facade& wall, const BuildingPlan& plan) {
  const double width = plan.side_m / plan.windows;
  for (int floor = 0; floor < plan.floors; ++floor)
    for (int window = 0; window < plan.windows; ++window) {
      const Opening cell{window * width, (window + 1) * width, floor * plan.floor_m, (floor + 1) * plan.floor_m};
      const Opening hole{cell.left_m + 0.25 * width, cell.right_m - 0.25 * width, cell.sill_m + 0.875,
                         cell.head_m - 0.5};
      append_window(mesh, wall, cell, hole);
    }
}

// A flat roof inside a parapet that has an outside, an inside and a rim.
void append_roof(MeshData& mesh, const BuildingPlan& plan) {
  const double outer = plan.side_m / 2, inner = outer - 0.375;
  const double roof = plan.floors * plan.floor_m, rim = roof + kParapet_m;
  const auto corner = [](double half, int i, double y) {
    return glm::dvec3(i == 0 || i == 3 ? -half : half, y, i < 2 ? half : -half);
  };
  for (int i = 0; i < 4; ++i) {
    const int next = (i + 1) % 4;
    append_quad(mesh, corner(outer, i, roof), corner(outer, next, roof), corner(outer, next, rim),
                corner(outer, i, rim));
    append_quad(mesh, corner(outer, i, rim), corner(outer, next, rim), corner(inner, next, rim), corner(inner, i, rim));
    append_quad(mesh, corner(inner, i, rim), corner(inner, next, rim), corner(inner, next, roof),
                corner(inner, i, roof));
  }
  append_quad(mesh, corner(inner, 0, roof), corner(inner, 1, roof), corner(inner, 2, roof), corner(inner, 3, roof));
}

}  // namespace

MeshData make_building(const BuildingPlan& plan) {
  MeshData mesh;
  const double half = plan.side_m / 2;
  append_facade(mesh, {{-half, 0, half}, {1, 0, 0}, {0, 0, -1}}, plan);
  append_facade(mesh, {{half, 0, half}, {0, 0, -1}, {-1, 0, 0}}, plan);
  append_facade(mesh, {{half, 0, -half}, {-1, 0, 0}, {0, 0, 1}}, plan);
  append_facade(mesh, {{-half, 0, -half}, {0, 0, 1}, {1, 0, 0}}, plan);
  append_roof(mesh, plan);
  return mesh;
}

}  // namespace sightline::scenes
