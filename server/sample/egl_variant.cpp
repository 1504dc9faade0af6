#include "server/sample/egl_variant.h"

namespace sightline {

std::string to_string(const EglVariant& variant) {
  std::string text = variant.detail == Detail::kTriangles ? "triangles" : "clusters";
  text.append(variant.draw_per_map ? "+per-map" : "+at-once");
  text.append(variant.ring ? "+ring" : "+direct");
  return text;
}

std::optional<EglVariant> parse_egl_variant(std::string_view text) {
  for (const EglVariant& variant : all_egl_variants())
    if (to_string(variant) == text) return variant;
  return std::nullopt;
}

std::vector<EglVariant> all_egl_variants() {
  std::vector<EglVariant> all;
  for (const Detail detail : {Detail::kTriangles, Detail::kClusters})
    for (const bool draw_per_map : {false, true})
      for (const bool ring : {false, true}) all.push_back({detail, draw_per_map, ring});
  return all;
}

}  // namespace sightline
