// A small writer of SVG pictures that read well on light and on dark paper.
#pragma once

#include <glm/glm.hpp>
#include <span>
#include <string>
#include <string_view>

namespace sightline {

// Positions in pixels from the top left. Colours are CSS ones; the classes "ink", "faint", "grid" and "wall"
// follow the reader's light or dark scheme. Coordinates are written with two decimals, so equal input gives
// equal bytes.
class Svg {
 public:
  Svg(double width, double height);

  enum class Anchor { kStart, kMiddle, kEnd };
  void text(const glm::dvec2& at, const std::string& words, Anchor anchor = Anchor::kStart, double size = 12,
            std::string_view css_class = "ink");
  void line(const glm::dvec2& from, const glm::dvec2& to, std::string_view css_class);
  void rectangle(const glm::dvec2& corner, const glm::dvec2& size, const std::string& fill);
  void circle(const glm::dvec2& center, double radius, const std::string& fill);
  // `dashes`: as stroke-dasharray; empty: a full line.
  void polyline(std::span<const glm::dvec2> points, const std::string& stroke, double width,
                const std::string& dashes = "");
  void area(std::span<const glm::dvec2> points, const std::string& fill);
  // Many separate lines as one element.
  void segments(std::span<const glm::dvec2> ends_in_pairs, std::string_view css_class);

  // The whole document; the writer is then used up.
  std::string finish();

 private:
  std::string body_;
};

}  // namespace sightline
