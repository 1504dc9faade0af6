#include "scenes/vehicle_path.h"

#include <algorithm>
#include <cmath>

#include "scenes/shapes.h"

namespace sightline::scenes {
namespace {

constexpr double kSample_m = 0.5;
constexpr double kLeast_mps = 0.5;  // of a sample, so that every piece takes a finite time
constexpr int kArcPieces = 12;

struct Sample {
  glm::dvec2 p;
  double fastest_mps;
};

// From the last sample to `to` in pieces of at most kSample_m.
void append_straight(std::vector<Sample>& samples, const glm::dvec2& to, double fastest_mps) {
  const glm::dvec2 from = samples.back().p;
  const int pieces = std::max(1, static_cast<int>(std::ceil(length(to - from) / kSample_m)));
  for (int k = 1; k <= pieces; ++k)
    samples.push_back({from + (to - from) * (static_cast<double>(k) / pieces), fastest_mps});
}

// A quadratic Bezier curve between two points on the legs of a corner. At a right angle, its least radius is a third
// below the radius of the arc through the same points. The speed allows for it.
void append_corner(std::vector<Sample>& samples, const glm::dvec2& from, const glm::dvec2& corner, const glm::dvec2& to,
                   double fastest_mps) {
  for (int k = 1; k <= kArcPieces; ++k) {
    const double u = static_cast<double>(k) / kArcPieces;
    samples.push_back({from * ((1 - u) * (1 - u)) + corner * (2 * u * (1 - u)) + to * (u * u), fastest_mps});
  }
}

std::vector<Sample> rounded(const Polyline& line, const DriveLimits& limits) {
  std::vector<Sample> samples{{line[0], limits.cruise_mps}};
  for (size_t k = 1; k < line.size(); ++k) {
    if (k + 1 == line.size()) {
      append_straight(samples, line[k], limits.cruise_mps);
      break;
    }
    const glm::dvec2 in = line[k] - line[k - 1], out = line[k + 1] - line[k];
    const double radius = std::min({limits.corner_radius_m, length(in) / 2, length(out) / 2});
    const glm::dvec2 from = line[k] - in * (radius / length(in)), to = line[k] + out * (radius / length(out));
    append_straight(samples, from, limits.cruise_mps);
    append_corner(samples, from, line[k], to,
                  std::min(limits.cruise_mps, std::sqrt(limits.lateral_mps2 * radius * 2 / 3)));
  }
  return samples;
}

// The greatest speed at each sample that brakes and engine allow.
std::vector<double> speeds_mps(const std::vector<Sample>& samples, const DriveLimits& limits) {
  std::vector<double> speeds;
  for (const Sample& sample : samples) speeds.push_back(sample.fastest_mps);
  if (limits.stops) speeds.back() = kLeast_mps;
  const auto reach = [&](size_t from, size_t to, double acceleration) {
    const double faster = std::sqrt(speeds[from] * speeds[from] +
                                    2 * acceleration * length(samples[to].p - samples[from].p));
    speeds[to] = std::min(speeds[to], faster);
  };
  for (size_t k = speeds.size() - 1; k > 0; --k) reach(k, k - 1, limits.brake_mps2);
  for (size_t k = 0; k + 1 < speeds.size(); ++k) reach(k, k + 1, limits.speed_up_mps2);
  return speeds;
}

}  // namespace

TimedPath drive_along(const Polyline& line, const DriveLimits& limits) {
  const std::vector<Sample> samples = rounded(line, limits);
  const std::vector<double> speeds = speeds_mps(samples, limits);
  Polyline corners{samples[0].p};
  std::vector<double> times_s{0};
  for (size_t k = 1; k < samples.size(); ++k) {
    const double piece_m = length(samples[k].p - samples[k - 1].p);
    if (piece_m < 1e-9) continue;
    corners.push_back(samples[k].p);
    times_s.push_back(times_s.back() + 2 * piece_m / (speeds[k] + speeds[k - 1]));
  }
  if (limits.stops) {
    corners.push_back(corners.back());
    times_s.push_back(times_s.back() + 1);
  }
  return {corners, times_s};
}

MeshData vehicle_mesh(double length_m, double height_m) {
  MeshData mesh;
  const double half = length_m / 2;
  append_box(mesh, {-0.875, 0.25, -half}, {0.875, 0.5 * height_m, half});
  append_box(mesh, {-0.75, 0.5 * height_m, -0.6 * half}, {0.75, height_m, 0.5 * half});
  for (const double z : {-0.6 * half, 0.6 * half})
    append_box(mesh, {-0.8125, 0, z - 0.3125}, {0.8125, 0.25, z + 0.3125});
  return mesh;
}

}  // namespace sightline::scenes
