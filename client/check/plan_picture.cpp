#include "client/check/plan_picture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "client/base/text_table.h"
#include "client/check/level_triangles.h"

namespace sightline {
namespace {

constexpr int kWidest = 760, kHighest = 640;  // of the plan, pixels
constexpr int kMargin = 24, kColumn = 240;    // the person's column
constexpr double kPersonM = 1.8;
constexpr double kFloor = 0.5;  // from this y of the normal on, up or down, a surface is shown as an area
constexpr Rgb kPaper{255, 255, 255}, kInk{40, 40, 44}, kWall{70, 70, 78}, kGlass{86, 160, 220}, kActor{220, 120, 20};

using Point = glm::dvec2;  // pixels; y downwards

void plot(Picture& picture, int x, int y, Rgb colour) {
  if (x >= 0 && y >= 0 && x < picture.width && y < picture.height) picture.at(x, y) = colour;
}

void draw_line(Picture& picture, const Point& from, const Point& to, Rgb colour) {
  const glm::dvec2 way = to - from;
  const int steps = 1 + static_cast<int>(std::max(std::abs(way.x), std::abs(way.y)));
  for (int i = 0; i <= steps; ++i) {
    const Point p = from + way * (static_cast<double>(i) / steps);
    plot(picture, static_cast<int>(p.x), static_cast<int>(p.y), colour);
  }
}

double cross(const Point& a, const Point& b) {
  return a.x * b.y - a.y * b.x;
}

// Calls visit(x, y) for each pixel whose middle is in the shape of `corners`, which is convex.
template <size_t kCorners, typename Visit>
void for_each_pixel_in(const std::array<Point, kCorners>& corners, int width, int height, Visit visit) {
  Point low = corners[0], high = corners[0];
  for (const Point& corner : corners) low = glm::min(low, corner), high = glm::max(high, corner);
  const int x0 = std::max(0, static_cast<int>(low.x)), x1 = std::min(width - 1, static_cast<int>(high.x));
  const int y0 = std::max(0, static_cast<int>(low.y)), y1 = std::min(height - 1, static_cast<int>(high.y));
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x) {
      bool left = true, right = true;
      for (size_t k = 0; k < kCorners; ++k) {
        const Point& from = corners[k];
        const double side = cross(corners[(k + 1) % kCorners] - from, Point(x + 0.5, y + 0.5) - from);
        left = left && side >= 0.0, right = right && side <= 0.0;
      }
      if (left || right) visit(x, y);
    }
}

void fill_box(Picture& picture, const Point& low, const Point& high, Rgb colour) {
  for_each_pixel_in(std::array{low, Point(high.x, low.y), high, Point(low.x, high.y)}, picture.width, picture.height,
                    [&](int x, int y) { picture.at(x, y) = colour; });
}

class Plan {
 public:
  Plan(const Level& level, const LevelFacts& facts)
      : level_(level),
        facts_(facts),
        size_m_(facts.size_m()),
        pixels_per_m_(
            std::min({kWidest / std::max(size_m_.x, 1e-9), kHighest / std::max(size_m_.z, 1e-9), kHighest / kPersonM})),
        width_(std::max(1, static_cast<int>(size_m_.x * pixels_per_m_))),
        height_(std::max(1, static_cast<int>(size_m_.z * pixels_per_m_))),
        picture_(width_ + kColumn + 3 * kMargin, std::max(height_, kHighest) + 3 * kMargin, kPaper),
        heights_m_(static_cast<size_t>(width_) * static_cast<size_t>(height_),
                   -std::numeric_limits<double>::infinity()) {}

  Picture draw() {
    for_each_visible([this](bool stands, const LevelTriangle& triangle) {
      if (stands && triangle.hides && std::abs(triangle.normal.y) >= kFloor) draw_floor(triangle);
    });
    for_each_visible([this](bool stands, const LevelTriangle& triangle) {
      if (!stands)
        outline(triangle, kActor);
      else if (!triangle.hides)
        outline(triangle, kGlass);
      else if (std::abs(triangle.normal.y) < kFloor)
        outline(triangle, kWall);
    });
    caption();
    draw_person();
    draw_scale();
    return std::move(picture_);
  }

 private:
  template <typename Visit>
  void for_each_visible(Visit visit) const {
    const std::span<const Instance> instances = level_.mirror->instances();
    for (uint32_t slot = 0; slot < instances.size(); ++slot)
      if (instances[slot].attributes.visible)
        for_each_triangle(instances[slot],
                          [&](const LevelTriangle& triangle) { visit(level_.stands(slot), triangle); });
  }

  // In the plan's own rectangle.
  Point place(const glm::dvec3& world_m) const {
    return Point(world_m.x - facts_.min_m.x, world_m.z - facts_.min_m.z) * pixels_per_m_;
  }
  std::array<Point, 3> places(const LevelTriangle& triangle) const {
    const auto& [a, b, c] = triangle.corners_m;
    return {place(a), place(b), place(c)};
  }

  // The highest surface is what is seen from above.
  void draw_floor(const LevelTriangle& triangle) {
    const auto& [a, b, c] = triangle.corners_m;
    const double height_m = (a.y + b.y + c.y) / 3.0;
    const double share = size_m_.y > 0.0 ? (height_m - facts_.min_m.y) / size_m_.y : 0.0;
    const auto grey = static_cast<uint8_t>(205.0 + 35.0 * std::clamp(share, 0.0, 1.0));
    for_each_pixel_in(places(triangle), width_, height_, [&](int x, int y) {
      double& known_m = heights_m_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
      if (height_m < known_m) return;
      known_m = height_m;
      picture_.at(x + kMargin, y + kMargin) = {grey, grey, grey};
    });
  }

  void outline(const LevelTriangle& triangle, Rgb colour) {
    const std::array<Point, 3> corners = places(triangle);
    for (size_t k = 0; k < 3; ++k)
      draw_line(picture_, corners[k] + Point(kMargin), corners[(k + 1) % 3] + Point(kMargin), colour);
  }

  void caption() {
    const std::string text = formatted("%.4g x %.4g m, %.4g m high", size_m_.x, size_m_.z, size_m_.y);
    draw_text(picture_, kMargin, picture_.height - kMargin - 14, 2, text + "   +X right, +Z down", kInk);
  }

  Point column_foot() const { return {2.0 * kMargin + width_ + 0.5 * kColumn, kMargin + kHighest - 60.0}; }

  // A person seen from the front: legs, body, head. Shorter than a pixel, it is still a dot.
  void draw_person() {
    const Point foot = column_foot();
    const double m = std::min(pixels_per_m_, (foot.y - kMargin - 30.0) / kPersonM);
    const auto box = [&](double left_m, double right_m, double low_m, double high_m) {
      fill_box(picture_, foot + Point(left_m, -high_m) * m, foot + Point(right_m, -low_m) * m, kInk);
    };
    box(-0.20, -0.03, 0.0, 0.85), box(0.03, 0.20, 0.0, 0.85);
    box(-0.26, 0.26, 0.80, 1.45), box(-0.10, 0.10, 1.45, kPersonM);
    plot(picture_, static_cast<int>(foot.x), static_cast<int>(foot.y) - 1, kInk);
    text_in_column(6, "a person of 1.8 m");
  }

  // A bar of 1, 2 or 5 times a power of ten, in metres.
  void draw_scale() {
    const double most_m = 0.8 * kColumn / pixels_per_m_, power = std::pow(10.0, std::floor(std::log10(most_m)));
    const double length_m = power * (most_m >= 5.0 * power ? 5.0 : most_m >= 2.0 * power ? 2.0 : 1.0);
    const Point middle = column_foot() + Point(0.0, 44.0), half(0.5 * length_m * pixels_per_m_, 0.0);
    fill_box(picture_, middle - half - Point(0.0, 2.0), middle + half + Point(0.0, 2.0), kInk);
    text_in_column(52, formatted("%g m", length_m));
  }

  void text_in_column(int below_foot, const std::string& text) {
    const Point foot = column_foot();
    draw_text(picture_, static_cast<int>(foot.x) - text_width(text, 2) / 2, static_cast<int>(foot.y) + below_foot, 2,
              text, kInk);
  }

  const Level& level_;
  const LevelFacts& facts_;
  const glm::dvec3 size_m_;
  const double pixels_per_m_;
  const int width_, height_;  // of the plan's rectangle
  Picture picture_;
  std::vector<double> heights_m_;  // of the plan's pixels: the highest surface so far
};

}  // namespace

Picture draw_plan(const Level& level, const LevelFacts& facts) {
  return Plan(level, facts).draw();
}

}  // namespace sightline
