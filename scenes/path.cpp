#include "scenes/path.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace sightline::scenes {
namespace {

glm::dvec2 left_of(const glm::dvec2& from, const glm::dvec2& to) {
  const glm::dvec2 d = (to - from) / length(to - from);
  return {d.y, -d.x};
}

}  // namespace

double length(const glm::dvec2& v) {
  return std::sqrt(v.x * v.x + v.y * v.y);
}

double length(const Polyline& line) {
  double sum = 0;
  for (size_t i = 1; i < line.size(); ++i) sum += length(line[i] - line[i - 1]);
  return sum;
}

Polyline parallel(const Polyline& line, const std::vector<double>& distances_m) {
  assert(distances_m.size() == line.size());
  Polyline result;
  for (size_t i = 0; i < line.size(); ++i) {
    const glm::dvec2 before = i > 0 ? left_of(line[i - 1], line[i]) : left_of(line[0], line[1]);
    const glm::dvec2 after = i + 1 < line.size() ? left_of(line[i], line[i + 1]) : before;
    const double alignment = before.x * after.x + before.y * after.y;
    result.push_back(line[i] + (before + after) * (distances_m[i] / (1 + alignment)));
  }
  return result;
}

Polyline parallel(const Polyline& line, double distance_m) {
  return parallel(line, std::vector<double>(line.size(), distance_m));
}

TimedPath::TimedPath(Polyline corners, std::vector<double> times_s)
    : corners_(std::move(corners)), times_s_(std::move(times_s)), integrals_{glm::dvec2(0.0)} {
  assert(corners_.size() >= 2 && corners_.size() == times_s_.size());
  for (size_t i = 1; i < corners_.size(); ++i)
    integrals_.push_back(integrals_.back() + (corners_[i - 1] + corners_[i]) * (0.5 * (times_s_[i] - times_s_[i - 1])));
}

size_t TimedPath::leg_at(double time_s) const {
  const auto after = std::upper_bound(times_s_.begin(), times_s_.end(), time_s) - times_s_.begin();
  return static_cast<size_t>(std::clamp<ptrdiff_t>(after - 1, 0, static_cast<ptrdiff_t>(times_s_.size()) - 2));
}

glm::dvec2 TimedPath::leg_velocity(size_t leg) const {
  return (corners_[leg + 1] - corners_[leg]) / (times_s_[leg + 1] - times_s_[leg]);
}

glm::dvec2 TimedPath::sharp(double time_s) const {
  const size_t leg = leg_at(time_s);
  return corners_[leg] + leg_velocity(leg) * (time_s - times_s_[leg]);
}

glm::dvec2 TimedPath::integral(double time_s) const {
  const size_t leg = leg_at(time_s);
  const double dt = time_s - times_s_[leg];
  return integrals_[leg] + corners_[leg] * dt + leg_velocity(leg) * (0.5 * dt * dt);
}

glm::dvec2 TimedPath::position_m(double time_s) const {
  return (integral(time_s + kTurnWindow_s / 2) - integral(time_s - kTurnWindow_s / 2)) / kTurnWindow_s;
}

glm::dvec2 TimedPath::velocity_mps(double time_s) const {
  return (sharp(time_s + kTurnWindow_s / 2) - sharp(time_s - kTurnWindow_s / 2)) / kTurnWindow_s;
}

}  // namespace sightline::scenes
