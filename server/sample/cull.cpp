#include "server/sample/cull.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace sightline {
namespace {

struct Interval {
  float low, high;
};
// The whole numbers in [0, count) that a quotient numerator / depth may come within the margin of.
struct SampleRange {
  int first = 0, last = -1;
  bool empty() const { return last < first; }
};
SampleRange samples_met(const Interval& numerator, const Interval& depth, int count) {
  constexpr float kMargin = static_cast<float>(kSampleMarginTexels);
  const float low = numerator.low / (numerator.low < 0 ? depth.low : depth.high) - kMargin;
  const float high = numerator.high / (numerator.high < 0 ? depth.high : depth.low) + kMargin;
  const float end = static_cast<float>(count - 1);
  if (!(high >= 0 && low <= end)) return {};
  return {static_cast<int>(std::ceil(std::max(low, 0.0f))), static_cast<int>(std::floor(std::min(high, end)))};
}

float row_slack(const glm::vec4& row, float reach_m) {
  return 1e-6f * (glm::length(glm::vec3(row)) * reach_m + std::abs(row.w));
}

// A row vector over instance coordinates: dot(direction, world position - eye).
glm::dvec4 row_over_instance(const glm::dvec3& direction, const Affine& world_from_instance,
                             const glm::dvec3& from_eye) {
  return {glm::dot(direction, world_from_instance[0]), glm::dot(direction, world_from_instance[1]),
          glm::dot(direction, world_from_instance[2]), glm::dot(direction, from_eye)};
}

}  // namespace

ClipMap clip_map(const MapView& view) {
  const double width = view.right - view.left, height = view.top - view.bottom;
  const double shift_x = (view.jitter.x - 0.5) * width / view.width,
               shift_y = (view.jitter.y - 0.5) * height / view.height;
  return {view.world_from_view[0],
          view.world_from_view[1],
          view.world_from_view[2],
          2.0 / width,
          (view.left + view.right + 2.0 * shift_x) / width,
          2.0 / height,
          (view.bottom + view.top + 2.0 * shift_y) / height};
}

ClipRows clip_rows(const ClipMap& clip, const MapView& view, const Affine& world_from_instance) {
  const glm::dvec3 from_eye = world_from_instance[3] - view.eye_m;
  const glm::dvec4 x = row_over_instance(clip.view_x, world_from_instance, from_eye),
                   y = row_over_instance(clip.view_y, world_from_instance, from_eye),
                   z = row_over_instance(clip.view_z, world_from_instance, from_eye);
  return {clip.scale_x * x + clip.skew_x * z, clip.scale_y * y + clip.skew_y * z, -z};
}

SampleGrid sample_grid(const ClipRows& rows, const MapView& view) {
  const double half_width = 0.5 * view.width, half_height = 0.5 * view.height;
  return {glm::vec4(half_width * rows.x + (half_width - 0.5) * rows.w),
          glm::vec4(half_height * rows.y + (half_height - 0.5) * rows.w),
          glm::vec4(rows.w),
          static_cast<float>(view.near_m),
          view.width,
          view.height};
}

GridSlack grid_slack(const SampleGrid& grid, const Aabb& bounds) {
  const float reach_m = glm::length(glm::max(glm::abs(bounds.min), glm::abs(bounds.max)));
  return {row_slack(grid.x, reach_m), row_slack(grid.y, reach_m), row_slack(grid.w, reach_m)};
}

BoxTest::BoxTest(const SampleGrid& grid, const Aabb& bounds)
    : grid_(grid), slack_(grid_slack(grid, bounds)), play_{slack_.x, slack_.y, slack_.w, 0.0f} {
  for (int axis = 0; axis < 4; ++axis) column_[axis] = {grid.x[axis], grid.y[axis], grid.w[axis], 0.0f};
  for (int axis = 0; axis < 3; ++axis)
    for (size_t row = 0; row < 4; ++row) magnitude_[axis][row] = std::abs(column_[axis][row]);
  const glm::dmat3 from_samples = glm::inverse(
      glm::transpose(glm::dmat3(glm::dvec3(grid.x), glm::dvec3(grid.y), glm::dvec3(grid.w))));
  ray_x_ = from_samples[0], ray_y_ = from_samples[1], ray_ = from_samples[2];
  eye_ = -(from_samples * glm::dvec3(grid.x.w, grid.y.w, grid.w.w));
  // The displacement of a position that changes x, y and w by their slack.
  eye_play_ = glm::abs(ray_x_) * slack_.x + glm::abs(ray_y_) * slack_.y + glm::abs(ray_) * slack_.w +
              1e-6f * (glm::abs(eye_) + glm::max(glm::abs(bounds.min), glm::abs(bounds.max)));
}

bool BoxTest::may_show(const Aabb& box, Footprint& where) const {
  const glm::vec3 center = box.center(), half = box.half_extent();
  std::array<float, 4> low, high;
  for (size_t row = 0; row < 4; ++row) {
    const float middle = column_[0][row] * center.x + column_[1][row] * center.y + column_[2][row] * center.z +
                         column_[3][row];
    const float reach = magnitude_[0][row] * half.x + magnitude_[1][row] * half.y + magnitude_[2][row] * half.z +
                        play_[row];
    low[row] = middle - reach, high[row] = middle + reach;
  }
  const Interval across{low[0], high[0]}, up{low[1], high[1]}, depth{low[2], high[2]};
  if (depth.high < grid_.near_m) return false;
  SampleRange x{0, grid_.width - 1}, y{0, grid_.height - 1};
  if (depth.low < 0.5f * grid_.near_m) {
    // A box that reaches behind the near plane has no bounded projection, but may lie outside the samples' pyramid.
    if (is_beside(box)) return false;
  } else {
    x = samples_met(across, depth, grid_.width);
    if (x.empty()) return false;
    y = samples_met(up, depth, grid_.height);
    if (y.empty()) return false;
  }
  where.near_depth_m = std::max(depth.low, grid_.near_m);
  where.x0 = static_cast<uint8_t>(x.first), where.x1 = static_cast<uint8_t>(x.last);
  where.y0 = static_cast<uint8_t>(y.first), where.y1 = static_cast<uint8_t>(y.last);
  return true;
}

bool BoxTest::is_beside(const Aabb& box) const {
  const glm::vec3 center = box.center(), half = box.half_extent();
  const auto farthest_inside = [&](const glm::vec4& side, float slack) {
    return glm::dot(glm::vec3(side), center) + side.w + glm::dot(glm::abs(glm::vec3(side)), half) + slack;
  };
  constexpr float kMargin = static_cast<float>(kSampleMarginTexels);
  const float wide_x = static_cast<float>(grid_.width - 1) + kMargin,
              wide_y = static_cast<float>(grid_.height - 1) + kMargin;
  const float slack_x = slack_.x + wide_x * slack_.w, slack_y = slack_.y + wide_y * slack_.w;
  return farthest_inside(grid_.x + kMargin * grid_.w, slack_x) < 0 ||
         farthest_inside(wide_x * grid_.w - grid_.x, slack_x) < 0 ||
         farthest_inside(grid_.y + kMargin * grid_.w, slack_y) < 0 ||
         farthest_inside(wide_y * grid_.w - grid_.y, slack_y) < 0;
}

float BoxTest::enters_at_m(const Aabb& box, int sample_x, int sample_y) const {
  constexpr float kMargin = static_cast<float>(kSampleMarginTexels);
  const float x = static_cast<float>(sample_x), y = static_cast<float>(sample_y);
  float enter_m = grid_.near_m * (1.0f - kHidingMargin), leave_m = std::numeric_limits<float>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const float along = ray_x_[axis] * x + ray_y_[axis] * y + ray_[axis];
    const float thick = kMargin * (std::abs(ray_x_[axis]) + std::abs(ray_y_[axis])) +
                        1e-6f * (std::abs(ray_x_[axis]) * x + std::abs(ray_y_[axis]) * y + std::abs(ray_[axis]));
    // Above the lower face and below the upper one: along the ray's nearer side each holds up to or from some depth.
    const float to_low = box.min[axis] - eye_play_[axis] - eye_[axis],
                to_high = eye_[axis] - eye_play_[axis] - box.max[axis];
    for (const auto& [distance, speed] : {std::pair(to_low, along + thick), std::pair(to_high, thick - along)}) {
      // distance <= depth * speed
      if (speed > 0)
        enter_m = std::max(enter_m, distance / speed);
      else if (speed < 0)
        leave_m = std::min(leave_m, distance / speed);
      else if (distance > 0)
        return std::numeric_limits<float>::infinity();
    }
  }
  return enter_m * (1.0f - 1e-5f) <= leave_m ? enter_m : std::numeric_limits<float>::infinity();
}

bool BoxTest::may_show_unhidden(const Aabb& box, const Footprint& where, const float* hidden_from_m) const {
  // A box over many samples is hit by one of their rays.
  constexpr int kFewSamples = 12;
  if ((where.x1 - where.x0 + 1) * (where.y1 - where.y0 + 1) > kFewSamples)
    return !is_hidden(where, hidden_from_m, grid_.width);
  const float nearest_m = where.near_depth_m * (1.0f - kHidingMargin);
  for (int y = where.y0; y <= where.y1; ++y)
    for (int x = where.x0; x <= where.x1; ++x) {
      const float hidden_m = hidden_from_m[y * grid_.width + x];
      if (hidden_m < nearest_m) continue;
      const float enter_m = enters_at_m(box, x, y);
      if (std::isfinite(enter_m) && !(hidden_m < enter_m * (1.0f - kHidingMargin))) return true;
    }
  return false;
}

bool is_hidden(const Footprint& footprint, const float* hidden_from_m, int width) {
  const float nearest_m = footprint.near_depth_m * (1.0f - kHidingMargin);
  for (int y = footprint.y0; y <= footprint.y1; ++y)
    for (int x = footprint.x0; x <= footprint.x1; ++x)
      if (!(hidden_from_m[y * width + x] < nearest_m)) return false;
  return true;
}

}  // namespace sightline
