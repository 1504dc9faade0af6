#include "server/move/goal.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/move/random_nodes.h"

namespace sightline {
namespace {

using namespace test;

// Candidates, and all data that a goal is chosen by.
struct Field {
  Nodes nodes;
  std::vector<uint8_t> members;
  std::vector<TrackedTarget> targets;
  RouteSettings routes;
  MoveSettings settings;
  glm::dvec3 desired_m{0.0};
  std::optional<glm::dvec3> former_goal_m;
  uint32_t start = 0;

  RouteNodes view() const {
    RouteNodes view = nodes.view();
    view.spacing_m = 1.0;
    return view;
  }
  CandidateCosts costs() const {
    return {{.position_m = nodes.position_m,
             .hidden = nodes.hidden,
             .desired_m = desired_m,
             .former_goal_m = former_goal_m},
            settings.cost};
  }
};

Field random_field(Draw& draw) {
  Field field;
  field.nodes = random_nodes(draw);
  for (const double hidden : field.nodes.hidden) field.members.push_back(hidden < 0.5);
  TrackedTarget target;
  target.aim_m = draw.vec(3);
  target.weight = 1;
  field.targets = {target};
  field.routes = random_settings(draw);
  const auto often_none = [&](double most) { return draw.in(0, 1) < 0.3 ? 0.0 : draw.in(0, most); };
  field.settings.cost = {.occlusion = often_none(80),
                          .distance = often_none(2),
                          .edge_penalty = often_none(2),
                          .full_depth_m = draw.in(0.5, 4),
                          .route = often_none(1),
                          .steadiness = often_none(2)};
  field.settings.max_distance_m = draw.in(1.5, 20);
  field.desired_m = draw.vec(3);
  if (draw.in(0, 1) < 0.5) field.former_goal_m = draw.vec(2);
  field.start = static_cast<uint32_t>(draw.in(0, static_cast<double>(field.nodes.size())));
  return field;
}

struct Found {
  uint32_t goal = 0;
  std::vector<uint32_t> route;
  size_t settled = 0;
};

Found search(const Field& field, EdgeDepths& depths, RouteFinder& routes) {
  const RouteNodes nodes = field.view();
  depths.begin(field.nodes.cell, field.members);
  routes.begin(nodes, field.start, field.routes);
  const PlaceLimits limits(field.targets, field.settings);
  Found found;
  found.goal = find_goal({field.costs(), depths, limits, field.nodes.position_m}, routes);
  found.route = routes.to(found.goal);
  for (uint32_t i = 0; i < field.nodes.size(); ++i) found.settled += routes.is_settled(i);
  return found;
}

// The reference: it computes every route, depth and cost, and takes the least.
Found look_at_all(const Field& field) {
  const RouteNodes nodes = field.view();
  RouteFinder routes;
  routes.begin(nodes, field.start, field.routes);
  while (routes.settle_next()) {
  }
  EdgeDepths depths;
  depths.begin(field.nodes.cell, field.members);
  Found found;
  double least = INFINITY;
  for (uint32_t i = 0; i < field.nodes.size(); ++i) {
    if (!routes.is_settled(i)) continue;
    ++found.settled;
    double cost = field.costs().of(i, routes.cost_m(i), depths.squared(i, 1000));
    if (!within_limits(field.nodes.position_m[i], field.targets, field.settings)) cost += 1e4;
    if (cost < least) least = cost, found.goal = i;
  }
  found.route = routes.to(found.goal);
  return found;
}

TEST(Goal, IsTheCandidateOfLeastCostAmongAllRoutes) {
  Draw draw(71);
  EdgeDepths depths;
  RouteFinder routes;
  size_t settled = 0, reachable = 0, far = 0;
  for (int trial = 0; trial < 1500; ++trial) {
    const Field field = random_field(draw);
    const Found found = search(field, depths, routes), all = look_at_all(field);
    ASSERT_EQ(found.goal, all.goal) << "trial " << trial;
    ASSERT_EQ(found.route, all.route) << "trial " << trial;
    settled += found.settled, reachable += all.settled;
    far += found.route.size() > 1;
  }
  EXPECT_LT(settled, reachable / 2) << "with fewer ways";
  EXPECT_GT(far, 100u);
}

TEST(Goal, OfEqualsIsTheFirst) {
  Field field;
  for (int x = 0; x < 5; ++x) field.nodes.add({x, 0, 0}, {x, 0, 0}, 2.0, 0.0);
  field.members.assign(5, 1);
  field.targets.resize(1);
  field.targets[0].weight = 1;
  field.settings.min_distance_m = 0, field.settings.min_elevation_rad = -1;
  field.settings.cost = {.occlusion = 1, .distance = 0, .edge_penalty = 0, .route = 0};
  EdgeDepths depths;
  RouteFinder routes;
  for (field.start = 0; field.start < 5; ++field.start) EXPECT_EQ(search(field, depths, routes).goal, 0u);
}

}  // namespace
}  // namespace sightline
