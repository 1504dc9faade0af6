#include "client/evaluate/svg.h"

#include <cmath>
#include <initializer_list>

#include "client/base/text_table.h"

namespace sightline {
namespace {

std::string number(double value) {
  return formatted("%.2f", std::abs(value) < 0.005 ? 0.0 : value);
}

void add(std::string& out, std::initializer_list<std::string_view> parts) {
  for (const std::string_view part : parts) out += part;
}

std::string pair_of(const glm::dvec2& p) {
  return number(p.x).append(",").append(number(p.y));
}

std::string listed(std::span<const glm::dvec2> points) {
  std::string list;
  for (const glm::dvec2& p : points) {
    if (!list.empty()) list += ' ';
    list += pair_of(p);
  }
  return list;
}

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (static_cast<unsigned char>(c) < 0x20)
      out += ' ';
    else
      out += c;
  }
  return out;
}

constexpr std::string_view kStyle =
    "<style>\n"
    "text{font-family:system-ui,'DejaVu Sans',Helvetica,Arial,sans-serif;fill:#1b1f24}\n"
    ".paper{fill:#ffffff}.faint{fill:#656d76}.grid{stroke:#d8dee4;stroke-width:1}\n"
    ".wall{stroke:#57606a;stroke-width:1.2;fill:none}.mover{stroke:#a0a8b0;stroke-width:1;fill:none}\n"
    ".axis{stroke:#8c959f;stroke-width:1}\n"
    "@media (prefers-color-scheme:dark){\n"
    "text{fill:#e6edf3}.paper{fill:#0d1117}.faint{fill:#9198a1}.grid{stroke:#2b323a}\n"
    ".wall{stroke:#aab4be}.mover{stroke:#6a737d}.axis{stroke:#6a737d}\n"
    "}\n"
    "</style>\n";

}  // namespace

Svg::Svg(double width, double height) {
  const std::string w = number(width), h = number(height);
  add(body_, {"<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"", w, "\" height=\"", h, "\" viewBox=\"0 0 ",
              w, " ", h, "\">\n", kStyle, "<rect class=\"paper\" width=\"100%\" height=\"100%\"/>\n"});
}

void Svg::text(const glm::dvec2& at, const std::string& words, Anchor anchor, double size,
               std::string_view css_class) {
  const char* name = anchor == Anchor::kStart ? "start" : anchor == Anchor::kMiddle ? "middle" : "end";
  add(body_,
      {"<text class=\"", css_class, "\" x=\"", number(at.x), "\" y=\"", number(at.y), "\" font-size=\"",
       number(size), "\" text-anchor=\"", name, "\">", escaped(words), "</text>\n"});
}

void Svg::line(const glm::dvec2& from, const glm::dvec2& to, std::string_view css_class) {
  add(body_, {"<line class=\"", css_class, "\" x1=\"", number(from.x), "\" y1=\"", number(from.y), "\" x2=\"",
              number(to.x), "\" y2=\"", number(to.y), "\"/>\n"});
}

void Svg::rectangle(const glm::dvec2& corner, const glm::dvec2& size, const std::string& fill) {
  add(body_, {"<rect x=\"", number(corner.x), "\" y=\"", number(corner.y), "\" width=\"", number(size.x),
              "\" height=\"", number(size.y), "\" fill=\"", fill, "\"/>\n"});
}

void Svg::circle(const glm::dvec2& center, double radius, const std::string& fill) {
  add(body_, {"<circle cx=\"", number(center.x), "\" cy=\"", number(center.y), "\" r=\"", number(radius),
              "\" fill=\"", fill, "\"/>\n"});
}

void Svg::polyline(std::span<const glm::dvec2> points, const std::string& stroke, double width,
                   const std::string& dashes) {
  add(body_, {"<polyline fill=\"none\" stroke-linejoin=\"round\" stroke=\"", stroke, "\" stroke-width=\"",
              number(width), "\""});
  if (!dashes.empty()) add(body_, {" stroke-dasharray=\"", dashes, "\""});
  add(body_, {" points=\"", listed(points), "\"/>\n"});
}

void Svg::area(std::span<const glm::dvec2> points, const std::string& fill) {
  add(body_, {"<polygon fill=\"", fill, "\" points=\"", listed(points), "\"/>\n"});
}

void Svg::segments(std::span<const glm::dvec2> ends, std::string_view css_class) {
  if (ends.empty()) return;
  add(body_, {"<path class=\"", css_class, "\" d=\""});
  for (size_t i = 0; i + 1 < ends.size(); i += 2)
    add(body_, {"M", pair_of(ends[i]), "L", pair_of(ends[i + 1])});
  body_ += "\"/>\n";
}

std::string Svg::finish() {
  body_ += "</svg>\n";
  return std::move(body_);
}

}  // namespace sightline
