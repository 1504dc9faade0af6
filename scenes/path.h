// A walk: a polyline on the floor with a time at each corner, averaged over a sliding window. The average rounds each
// corner within the window and bounds the acceleration by |change of velocity| / window. It never leaves the convex
// hull of what the window covers, so a corridor around the polyline holds the walker as well.
#pragma once

#include <glm/glm.hpp>
#include <vector>

namespace sightline::scenes {

using Polyline = std::vector<glm::dvec2>;  // x, z in metres

inline constexpr double kTurnWindow_s = 0.3;

class TimedPath {
 public:
  // At least two corners; times strictly increasing. Before the first and after the last corner the walker
  // goes on along the first and last leg.
  TimedPath(Polyline corners, std::vector<double> times_s);

  glm::dvec2 position_m(double time_s) const;
  glm::dvec2 velocity_mps(double time_s) const;

 private:
  size_t leg_at(double time_s) const;
  glm::dvec2 leg_velocity(size_t leg) const;
  glm::dvec2 sharp(double time_s) const;     // on the polyline itself
  glm::dvec2 integral(double time_s) const;  // of `sharp` from the first corner's time

  Polyline corners_;
  std::vector<double> times_s_;
  std::vector<glm::dvec2> integrals_;  // at each corner
};

double length(const glm::dvec2& v);  // by sqrt: the same bits everywhere
double length(const Polyline& line);

// The parallel of `line` at `distance_m` to the left (seen from above: left of +x is -z), mitred.
Polyline parallel(const Polyline& line, double distance_m);
// The same with a distance for each corner.
Polyline parallel(const Polyline& line, const std::vector<double>& distances_m);

}  // namespace sightline::scenes
