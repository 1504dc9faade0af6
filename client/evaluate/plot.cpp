#include "client/evaluate/plot.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "client/evaluate/svg.h"
#include "client/base/text_table.h"

namespace sightline {
namespace {

using Anchor = Svg::Anchor;

// Distinct on white and on near-black, and for the colour-blind (after Okabe and Ito).
// `number`: of the policy among those shown; it decides for one that is not in the table of policies.
std::string color_of(const std::string& policy, size_t number) {
  static constexpr std::array<std::string_view, 8> kColors{"#8c8c8c", "#d98200", "#009e73", "#b565a7",
                                                           "#1f83d6", "#d1495b", "#7a9a01", "#6f5fd0"};
  const PolicyEntry* entry = find_policy(policy);
  const size_t index = entry ? static_cast<size_t>(entry - policies().data()) : number;
  return std::string(kColors[index % kColors.size()]);
}

std::string short_text(double value) {
  return formatted("%.3g", value);
}

std::string percent(double share) {
  return formatted("%.1f %%", 100 * share);
}

std::string title_of(const std::string& scene, uint64_t seed) {
  return scene + ", seed " + std::to_string(seed);
}

// A step of 1, 2 or 5 times a power of ten, so that `span` has about `count` of them.
double round_step(double span, double count) {
  const double raw = std::max(span, 1e-9) / count, power = std::pow(10.0, std::floor(std::log10(raw)));
  const double lead = raw / power;
  return power * (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10);
}

// ---- shares over time ----

struct Strip {
  double left, top, width, height, last_s;
  glm::dvec2 at(double time_s, double share) const {
    return {left + width * (last_s > 0 ? time_s / last_s : 0.0), top + height * (1 - share)};
  }
};

void draw_frame(Svg& svg, const Strip& strip, const std::string& greatest) {
  for (const double share : {0.0, 0.5, 1.0})
    svg.line(strip.at(0, share), strip.at(strip.last_s, share), "grid");
  svg.text({strip.left - 8, strip.top + 5}, greatest, Anchor::kEnd, 10, "faint");
  svg.text({strip.left - 8, strip.top + strip.height + 3}, "0", Anchor::kEnd, 10, "faint");
}

void draw_names(Svg& svg, const Strip& strip, const std::string& policy, const std::string& figure) {
  svg.text({strip.left + strip.width + 10, strip.top + 16}, policy, Anchor::kStart, 13);
  svg.text({strip.left + strip.width + 10, strip.top + 33}, figure, Anchor::kStart, 11, "faint");
}

void draw_share(Svg& svg, const Strip& strip, const RunRecord& run, size_t number) {
  draw_frame(svg, strip, "100 %");
  std::vector<glm::dvec2> points{strip.at(0, 0)};
  for (const JointSight& sight : run.sights) points.push_back(strip.at(sight.time_s, sight.least_share));
  points.push_back(strip.at(run.sights.empty() ? 0.0 : run.sights.back().time_s, 0));
  svg.area(points, color_of(run.policy, number));
  draw_names(svg, strip, run.policy, percent(run.metrics.all_clear()) + " joint");
}

// Of the frames' places from the first.
double offset_m(const RunRecord& run, size_t frame) {
  return glm::distance(run.path_m[frame], run.path_m.front());
}

void draw_offset(Svg& svg, const Strip& strip, const RunRecord& run, size_t number, double greatest_m) {
  draw_frame(svg, strip, short_text(greatest_m) + " m");
  std::vector<glm::dvec2> points;
  for (size_t i = 0; i < run.path_m.size(); ++i)
    points.push_back(strip.at(static_cast<double>(i) / run.rate_hz, offset_m(run, i) / greatest_m));
  svg.polyline(points, color_of(run.policy, number), 1.4);
  draw_names(svg, strip, run.policy, short_text(run.metrics.d_c_m) + " m in all");
}

// The strips of one plot, one below the other over one axis of time.
class Strips {
 public:
  Strips(std::span<const RunRecord> runs, const std::string& title, const std::string& subtitle,
         double last_s)
      : last_s_(last_s),
        bottom_(kTop + static_cast<double>(runs.size()) * (kHeight + kGap)),
        svg_(kLeft + kWidth + 150, bottom_ + 30) {
    if (runs.empty()) return;
    svg_.text({kLeft, 24}, title_of(runs.front().scene, runs.front().seed) + ": " + title, Anchor::kStart,
              16);
    svg_.text({kLeft, 42}, subtitle, Anchor::kStart, 11, "faint");
    draw_axis();
  }
  Strip strip(size_t i) const {
    return {kLeft, kTop + static_cast<double>(i) * (kHeight + kGap), kWidth, kHeight, last_s_};
  }
  Svg& svg() { return svg_; }

 private:
  static constexpr double kLeft = 60, kTop = 58, kWidth = 720, kHeight = 56, kGap = 24;

  void draw_axis() {
    const double step = round_step(last_s_, 8);
    const Strip axis{kLeft, bottom_ - kGap, kWidth, 0, last_s_};
    for (int k = 0; k * step <= last_s_ + 1e-9; ++k) {
      svg_.line(axis.at(k * step, 0), axis.at(k * step, 0) + glm::dvec2(0, 5), "axis");
      svg_.text(axis.at(k * step, 0) + glm::dvec2(0, 20), short_text(k * step) + " s", Anchor::kMiddle, 11,
                "faint");
    }
  }

  const double last_s_;
  const double bottom_;
  Svg svg_;
};

// ---- paths ----

struct Box {
  glm::dvec2 low{INFINITY}, high{-INFINITY};
  void include(const glm::dvec2& p) { low = glm::min(low, p), high = glm::max(high, p); }
};

std::vector<glm::dvec2> thinned(std::span<const glm::dvec3> path_m) {
  std::vector<glm::dvec2> points;
  for (size_t i = 0; i < path_m.size(); i += i + 3 < path_m.size() ? 3 : 1)
    points.emplace_back(path_m[i].x, path_m[i].z);
  return points;
}

// Round the cameras and the targets, with a margin: a city goes on beyond what matters.
Box view_box(const ScenePlan& plan, std::span<const RunRecord> runs) {
  Box box;
  for (const RunRecord& run : runs)
    for (const glm::dvec3& p : run.path_m) box.include({p.x, p.z});
  for (const auto& way : plan.targets_m)
    for (const glm::dvec2& p : way) box.include(p);
  const double margin = 2.0 + 0.05 * glm::length(box.high - box.low);
  box.low -= margin;
  box.high += margin;
  return box;
}

// What of a piece lies in the box; false: nothing (Liang and Barsky).
bool clip(PlanSegment& piece, const Box& box) {
  const glm::dvec2 from = piece.from_m, way = piece.to_m - piece.from_m;
  double enter = 0.0, leave = 1.0;
  for (int axis = 0; axis < 2; ++axis) {
    if (way[axis] == 0.0) {
      if (from[axis] < box.low[axis] || from[axis] > box.high[axis]) return false;
      continue;
    }
    const double a = (box.low[axis] - from[axis]) / way[axis], b = (box.high[axis] - from[axis]) / way[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  if (enter > leave) return false;
  piece = {from + way * enter, from + way * leave};
  return true;
}

class PathPlot {
 public:
  PathPlot(const ScenePlan& plan, std::span<const RunRecord> runs)
      : box_(view_box(plan, runs)),
        scale_(std::min(kWidth / (box_.high.x - box_.low.x), kHeight / (box_.high.y - box_.low.y))),
        size_((box_.high - box_.low) * scale_),
        svg_(std::max(size_.x + 2 * kMargin, 420.0), size_.y + 2 * kMargin + 60) {
    svg_.text({kMargin, 26}, title_of(plan.scene, plan.seed) + ": from above", Anchor::kStart, 16);
    grid();
    cut(plan.movers, "mover");
    cut(plan.walls, "wall");
    for (const auto& way : plan.targets_m) draw_way(way);
    for (size_t i = 0; i < runs.size(); ++i) draw_camera(runs[i], i);
    legend(runs);
  }
  std::string finish() { return svg_.finish(); }

 private:
  static constexpr double kWidth = 900, kHeight = 640, kMargin = 30, kTop = 66;

  glm::dvec2 at(const glm::dvec2& p) const { return glm::dvec2(kMargin, kTop) + (p - box_.low) * scale_; }

  void grid() {
    const double step = round_step(box_.high.x - box_.low.x, 8);
    for (double x = std::ceil(box_.low.x / step) * step; x <= box_.high.x; x += step)
      svg_.line(at({x, box_.low.y}), at({x, box_.high.y}), "grid");
    for (double z = std::ceil(box_.low.y / step) * step; z <= box_.high.y; z += step)
      svg_.line(at({box_.low.x, z}), at({box_.high.x, z}), "grid");
    svg_.text({kMargin, kTop + size_.y + 18},
              "grid " + short_text(step) + " m; dashed: targets; dots: starts", Anchor::kStart, 11, "faint");
  }
  void cut(const std::vector<PlanSegment>& pieces, std::string_view css_class) {
    std::vector<glm::dvec2> ends;
    for (PlanSegment piece : pieces)
      if (clip(piece, box_)) ends.push_back(at(piece.from_m)), ends.push_back(at(piece.to_m));
    svg_.segments(ends, css_class);
  }
  void draw_way(const std::vector<glm::dvec2>& way) {
    std::vector<glm::dvec2> points;
    for (const glm::dvec2& p : way) points.push_back(at(p));
    svg_.polyline(points, "#d1495b", 1.4, "4 3");
    if (!points.empty()) svg_.circle(points.front(), 3.5, "#d1495b");
  }
  void draw_camera(const RunRecord& run, size_t number) {
    std::vector<glm::dvec2> points = thinned(run.path_m);
    for (glm::dvec2& p : points) p = at(p);
    svg_.polyline(points, color_of(run.policy, number), 1.8);
    if (!points.empty()) svg_.circle(points.front(), 3.5, color_of(run.policy, number));
  }
  void legend(std::span<const RunRecord> runs) {
    double x = kMargin;
    for (size_t i = 0; i < runs.size(); ++i) {
      svg_.rectangle({x, 41}, {14, 4}, color_of(runs[i].policy, i));
      svg_.text({x + 19, 48}, runs[i].policy);
      x += 34 + 7.5 * static_cast<double>(runs[i].policy.size());
    }
  }

  const Box box_;
  const double scale_;
  const glm::dvec2 size_;
  Svg svg_;
};

// ---- bars ----

std::vector<std::string> scenes_of(std::span<const Group> groups) {
  std::vector<std::string> scenes;
  for (const Group& group : groups)
    if (std::find(scenes.begin(), scenes.end(), group.scene) == scenes.end()) scenes.push_back(group.scene);
  return scenes;
}

bool group_has(const Group& group, const Figure& figure) {
  return std::any_of(group.runs.begin(), group.runs.end(),
                     [&](const RunRecord* run) { return has(*run, figure); });
}

}  // namespace

std::string plot_shares(std::span<const RunRecord> runs) {
  double last_s = 0.0;
  for (const RunRecord& run : runs)
    if (!run.sights.empty()) last_s = std::max(last_s, run.sights.back().time_s);
  Strips strips(runs, "visible share of the target seen least",
                "joint: share of pictures with every target visible to 95 %", last_s);
  for (size_t i = 0; i < runs.size(); ++i) draw_share(strips.svg(), strips.strip(i), runs[i], i);
  return strips.svg().finish();
}

std::string plot_offsets(std::span<const RunRecord> runs) {
  double last_s = 0.0, greatest_m = 1e-3;
  for (const RunRecord& run : runs) {
    if (!run.path_m.empty())
      last_s = std::max(last_s, static_cast<double>(run.path_m.size() - 1) / run.rate_hz);
    for (size_t i = 0; i < run.path_m.size(); ++i) greatest_m = std::max(greatest_m, offset_m(run, i));
  }
  Strips strips(runs, "how far the camera is from where it started", "in all: the length of its path",
                last_s);
  for (size_t i = 0; i < runs.size(); ++i) draw_offset(strips.svg(), strips.strip(i), runs[i], i, greatest_m);
  return strips.svg().finish();
}

std::string plot_paths(const ScenePlan& plan, std::span<const RunRecord> runs) {
  return PathPlot(plan, runs).finish();
}

std::string plot_bars(const Figure& figure, std::span<const Group> groups) {
  constexpr double kLeft = 130, kTop = 52, kBar = 13, kGap = 16, kWidth = 560;
  double greatest = 0.0;
  for (const Group& group : groups) greatest = std::max(greatest, group.mean(figure));
  const std::vector<std::string> scenes = scenes_of(groups);
  const auto rows = static_cast<double>(
      std::count_if(groups.begin(), groups.end(), [&](const Group& g) { return group_has(g, figure); }));
  Svg svg(kLeft + kWidth + 210, kTop + rows * kBar + static_cast<double>(scenes.size()) * kGap + 16);
  svg.text({20, 28}, std::string(figure.meaning), Anchor::kStart, 16);
  double y = kTop;
  for (const std::string& scene : scenes) {
    svg.text({kLeft - 10, y + 11}, scene, Anchor::kEnd, 12);
    size_t number = 0;
    for (const Group& group : groups) {
      if (group.scene != scene || !group_has(group, figure)) continue;
      const double value = group.mean(figure), length = greatest > 0 ? kWidth * value / greatest : 0.0;
      svg.rectangle({kLeft, y}, {std::max(length, 0.5), kBar - 3}, color_of(group.policy, number++));
      svg.text({kLeft + length + 6, y + 9}, short_text(value).append("  ").append(group.policy),
               Anchor::kStart, 10, "faint");
      y += kBar;
    }
    y += kGap;
  }
  return svg.finish();
}

}  // namespace sightline
