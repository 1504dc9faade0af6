// The ways to have a device take maps. All give the same maps, bit for bit; which is fast depends on the device, so it is measured
// (egl_measure.h) and can be forced.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/sample/draw_list.h"

namespace sightline {

struct EglVariant {
  // What is drawn. Single triangles are searched on the CPU and sent anew for each take: little to draw. Clusters are drawn from
  // where the whole geometry stands on the device: little to search and to send.
  Detail detail = Detail::kTriangles;
  // One draw for the maps of all sizes, each choosing its viewport; or a draw for each map, with its viewport set before.
  bool draw_per_map = false;
  // Read back into a ring of buffers with fences, so that the next maps are searched while these are drawn; or at once.
  bool ring = false;
  bool operator==(const EglVariant&) const = default;
};

// "triangles+at-once+direct", "clusters+per-map+ring": detail, draws, read-back.
std::string to_string(const EglVariant& variant);
// Nothing for what to_string never says.
std::optional<EglVariant> parse_egl_variant(std::string_view text);
std::vector<EglVariant> all_egl_variants();

}  // namespace sightline
