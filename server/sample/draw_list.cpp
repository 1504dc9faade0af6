#include "server/sample/draw_list.h"

#include <algorithm>
#include <iterator>

namespace sightline {

DrawnTriangle find_triangle(const DrawList& list, uint32_t triangle) {
  const auto after = std::upper_bound(list.parts.begin(), list.parts.end(), triangle,
                                      [](uint32_t t, const DrawPart& part) { return t < part.first_triangle; });
  const DrawPart& part = *std::prev(after);
  return {&list.instances[part.instance], part.first_index + 3 * (triangle - part.first_triangle)};
}

}  // namespace sightline
