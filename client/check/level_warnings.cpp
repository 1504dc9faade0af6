#include "client/check/level_warnings.h"

#include <algorithm>
#include <optional>

#include "client/base/text_table.h"

namespace sightline {
namespace {

using Text = std::optional<std::string>;

// A level that is wider than high in its own frame is a slab. One that stands on its edge is narrow, and most of its
// surface faces the same way as its floor.
constexpr double kSlabShare = 0.25, kFloorFactor = 1.5;
constexpr size_t kManyTriangles = 10'000, kManySmall = 20;
constexpr double kNearlyAll = 0.9;
constexpr size_t kNamed = 5;
constexpr const char* kAxes[] = {"x", "y", "z"};

double longest(const glm::dvec3& size_m) {
  return std::max({size_m.x, size_m.y, size_m.z});
}

// Exporters write centimetres where an engine has them, and shrink to a hundredth when they correct that twice.
std::string other_unit(double length_m) {
  const bool large = length_m > 1.0;
  return formatted("; %s as large it is %.4g m long", large ? "a hundredth" : "a hundred times",
                   length_m * (large ? 0.01 : 100.0));
}

Text up_axis(const LevelFacts& facts) {
  const glm::dvec3 size = facts.size_m();
  const int thin = size.x < size.z ? 0 : 2, wide = 2 - thin;
  if (!(size[thin] <= kSlabShare * std::min(size.y, size[wide]))) return {};
  if (!(facts.facing_m2[static_cast<size_t>(thin)] > kFloorFactor * facts.facing_m2[1])) return {};
  return formatted("is %.4g m high and only %.4g m deep along %s, and most surfaces face that way", size.y, size[thin],
                   kAxes[thin]) +
         ": its floor seems to stand upright. Up must be +Y; tick \"+Y Up\" in the exporter, or turn the root node";
}

std::string named(const std::vector<SurfaceFinding>& findings) {
  std::string text;
  for (size_t i = 0; i < std::min(findings.size(), kNamed); ++i)
    text += (i == 0 ? "" : ", ") + printable(findings[i].name) + formatted(" (%.3g m2)", findings[i].area_m2);
  if (findings.size() > kNamed) text += formatted(" and %zu more", findings.size() - kNamed);
  return text;
}

Text thin_walls(const SurfaceFindings& surfaces) {
  if (surfaces.thin.empty()) return {};
  return formatted("walls thinner than %g m", kThinnestWallM) +
         " hide unreliably from bodies and cameras close to them: " + named(surfaces.thin) +
         ". Give them a thickness; leaves and cloth may stay";
}

Text one_sided(const SurfaceFindings& surfaces) {
  if (surfaces.one_sided.empty()) return {};
  return "surfaces with one side hide from both sides here, but an engine shows what is behind them: " +
         named(surfaces.one_sided) + ". Close the bodies, or make the material double-sided if both sides are meant";
}

Text one_mesh(const LevelFacts& facts) {
  const double share = static_cast<double>(facts.largest_mesh_triangles) /
                       static_cast<double>(std::max<size_t>(1, facts.stored_triangles));
  if (facts.stored_triangles < kManyTriangles || share < kNearlyAll) return {};
  return "the mesh " + printable(facts.largest_mesh) + formatted(" holds %.1f %% of the triangles", 100.0 * share) +
         ": its parts cannot move, open, or have attributes of their own. Export one object for each part";
}

Text nothing_hides(const LevelFacts& facts) {
  if (facts.hiding > 0) return {};
  return "nothing in it hides a target: it has no triangles, or attributes and materials switch all of them off";
}

Text no_colliders(const LevelFacts& facts) {
  if (facts.colliding > 0) return {};
  return "nothing in it collides: the camera will fly through walls. Leave `collides` on for what must stop it";
}

Text all_collide(const LevelFacts& facts) {
  if (facts.colliding < facts.instances || facts.small_colliding < kManySmall) return {};
  return formatted("everything collides, also %zu things shorter than %g m", facts.small_colliding, kSmallInstanceM) +
         ": the camera keeps clear of each. Switch `collides` off for what it may pass through, such as grass and "
         "cables";
}

}  // namespace

std::vector<LevelWarning> level_warnings(const Level& level, const LevelFacts& facts, const SurfaceFindings& surfaces) {
  std::vector<LevelWarning> warnings;
  for (const std::string& text : level.asset->warnings) warnings.push_back({"file", text});
  if (level.unplayable) warnings.push_back({"roles", to_string(*level.unplayable)});
  for (const std::string& text : level.session_warnings)
    warnings.push_back({"scale", text.starts_with("open.scene") ? text + other_unit(longest(facts.size_m())) : text});
  const std::pair<const char*, Text> further[] = {
      {"up_axis", up_axis(facts)},          {"nothing_hides", nothing_hides(facts)},
      {"thin_walls", thin_walls(surfaces)}, {"one_sided", one_sided(surfaces)},
      {"one_mesh", one_mesh(facts)},        {"no_colliders", no_colliders(facts)},
      {"all_collide", all_collide(facts)}};
  for (const auto& [kind, text] : further)
    if (text) warnings.push_back({kind, *text});
  return warnings;
}

}  // namespace sightline
