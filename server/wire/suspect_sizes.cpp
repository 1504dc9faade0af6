#include "server/wire/suspect_sizes.h"

#include <algorithm>
#include <cstdio>
#include <limits>
#include <span>

namespace sightline {
namespace {

struct Box {
  glm::dvec3 min_m{std::numeric_limits<double>::infinity()}, max_m{-std::numeric_limits<double>::infinity()};

  void grow(const NewInstance& instance) {
    const Aabb& box = instance.geometry->bounds;
    if (box.empty()) return;
    for (int corner = 0; corner < 8; ++corner) {
      const glm::dvec3 p(corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y,
                         corner & 4 ? box.max.z : box.min.z);
      const glm::dvec3 world_m = transform_point(instance.pose, instance.linear * p);
      min_m = glm::min(min_m, world_m), max_m = glm::max(max_m, world_m);
    }
  }
  bool empty() const { return !(min_m.x <= max_m.x); }
  double length_m() const { return std::max({max_m.x - min_m.x, max_m.y - min_m.y, max_m.z - min_m.z}); }
};

std::string sentence(const char* format, double length_m, double limit_m) {
  char text[256];
  std::snprintf(text, sizeof text, format, length_m, limit_m);
  return text;
}

double scene_length_m(const SessionOptions& options, bool& empty) {
  Box box;
  for (const NewInstance& instance : std::span(options.instances).first(options.scene_instances)) box.grow(instance);
  empty = box.empty();
  return empty ? 0.0 : box.length_m();
}

// The length of the shortest target; 0 when there is none.
double shortest_target_m(const SessionOptions& options) {
  double shortest_m = std::numeric_limits<double>::infinity();
  for (const Target& target : options.targets) {
    const auto found = std::ranges::find(options.instances, target.instance_id, &NewInstance::id);
    if (found == options.instances.end()) continue;
    Box box;
    box.grow(*found);
    if (!box.empty()) shortest_m = std::min(shortest_m, box.length_m());
  }
  return shortest_m < std::numeric_limits<double>::infinity() ? shortest_m : 0.0;
}

}  // namespace

std::vector<std::string> suspect_sizes(const SessionOptions& options) {
  std::vector<std::string> warnings;
  bool empty = true;
  const double scene_m = scene_length_m(options, empty);
  constexpr char kUnit[] = "; set open.scene.metres_per_unit if the file is not in metres";
  if (!empty && scene_m > kLongestSceneM)
    warnings.push_back(sentence("open.scene: is %.4g m long, more than %g m", scene_m, kLongestSceneM) + kUnit);
  if (!empty && scene_m < kShortestSceneM)
    warnings.push_back(sentence("open.scene: is %.4g m long, less than %g m", scene_m, kShortestSceneM) + kUnit);
  if (const double target_m = shortest_target_m(options); target_m > kLongestTargetM)
    warnings.push_back(
        sentence("open.targets: each target is at least %.4g m long, more than %g m", target_m, kLongestTargetM) +
        "; check the convention's unit and the sizes of the targets");
  return warnings;
}

}  // namespace sightline
