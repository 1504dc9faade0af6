// Random nodes of routes, for the tests of routes and goals.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/move/route.h"
#include "tests/support/triangle_soup.h"

namespace sightline::test {

struct Nodes {
  std::vector<glm::dvec3> position_m;
  std::vector<glm::ivec3> cell;
  std::vector<float> clearance_m;

  void add(const glm::ivec3& at, const glm::dvec3& place, double clearance) {
    cell.push_back(at), position_m.push_back(place);
    clearance_m.push_back(static_cast<float>(clearance));
  }
  size_t size() const { return cell.size(); }
  RouteNodes view() const { return {position_m, cell, clearance_m}; }
};

// A node lies anywhere in its cell. A cell holds no node, one or several, and a few nodes form an island far away.
inline Nodes random_nodes(Draw& draw) {
  Nodes nodes;
  const double filled = draw.in(0.3, 1.0), widest = draw.in(0.5, 2.0);
  const auto add = [&](const glm::ivec3& cell) {
    const glm::dvec3 place = glm::dvec3(cell) + (draw.in(0, 1) < 0.5 ? glm::dvec3(0.0) : draw.vec(0.5));
    nodes.add(cell, place, draw.in(0, 1) < 0.2 ? 0.0 : draw.in(0, widest));
  };
  for (int z = -2; z <= 2; ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -2; x <= 2; ++x)
        for (int copy = 0; copy < 3; ++copy)
          if (draw.in(0, 1) < (copy == 0 ? filled : 0.1)) add({x, y, z});
  for (int i = 0; i < 3; ++i) add({6 + i, 0, 0});
  return nodes;
}

inline double random_body_m(Draw& draw) {
  return draw.in(0, 0.6);
}

}  // namespace sightline::test
