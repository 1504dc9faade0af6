#include "client/page/contact_sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>

#include "client/truth/truth.h"

namespace sightline {
namespace {

// Colours that stay apart for people with any colour vision (Okabe & Ito, "Color universal design", 2008).
constexpr std::array<Rgb, 6> kTargetColours{
    {{230, 159, 0}, {86, 180, 233}, {204, 121, 167}, {240, 228, 66}, {0, 158, 115}, {213, 94, 0}}};
constexpr glm::vec3 kSky(0.86f, 0.90f, 0.95f), kFloor(0.80f, 0.74f, 0.64f), kStone(0.80f, 0.81f, 0.84f),
    kMover(0.80f, 0.42f, 0.36f);
constexpr float kHazeM = 60.0f;  // distance at which 63 % of a surface's colour has gone into the sky's

glm::vec3 to_vec(Rgb colour) {
  return glm::vec3(colour[0], colour[1], colour[2]) / 255.0f;
}
Rgb to_rgb(const glm::vec3& colour) {
  const glm::vec3 c = glm::clamp(colour, 0.0f, 1.0f) * 255.0f + 0.5f;
  return {static_cast<uint8_t>(c.r), static_cast<uint8_t>(c.g), static_cast<uint8_t>(c.b)};
}

class PanelPainter {
 public:
  PanelPainter(const DrawnScene& scene, const CameraFrame& frame, int width)
      : scene_(scene),
        frame_(frame),
        picture_(width, std::max(1, static_cast<int>(std::lround(width / frame.lens.aspect)))) {
    for (const Target& target : scene.targets) slots_.push_back(*scene.mirror.slot_of(target.instance_id));
  }

  Picture paint() {
    for (int y = 0; y < picture_.height; ++y)
      for (int x = 0; x < picture_.width; ++x) picture_.at(x, y) = to_rgb(smooth_colour(x, y));
    for (size_t k = 0; k < slots_.size(); ++k) outline(k);
    caption();
    return std::move(picture_);
  }

 private:
  Rgb colour_of(size_t k) const {
    return kTargetColours[(scene_.colours.empty() ? k : scene_.colours[k]) % kTargetColours.size()];
  }

  glm::vec3 direction(double x, double y) const {
    return sample_direction(frame_.camera, frame_.lens, x, picture_.height - y, picture_.width, picture_.height);
  }

  // Four rays a pixel.
  glm::vec3 smooth_colour(int x, int y) const {
    glm::vec3 sum(0.0f);
    for (const double dy : {0.25, 0.75})
      for (const double dx : {0.25, 0.75}) sum += colour(direction(x + dx, y + dy));
    return sum / 4.0f;
  }

  glm::vec3 colour(const glm::vec3& ray) const {
    const RayHit hit = scene_.occluders.trace(frame_.camera.position_m, ray, static_cast<float>(frame_.lens.near_m),
                                              std::numeric_limits<float>::infinity());
    if (hit.slot == UINT32_MAX) return kSky;
    const glm::vec3 normal = glm::normalize(hit.normal), view = glm::normalize(ray);
    const glm::vec3 facing = glm::dot(normal, view) > 0 ? -normal : normal;
    const glm::vec3 light = glm::normalize(glm::vec3(0.4f, 0.8f, 0.45f));
    const float shade = 0.45f + 0.35f * std::max(0.0f, glm::dot(facing, light)) - 0.2f * glm::dot(facing, view);
    const float haze = 1.0f - std::exp(-hit.distance_m * glm::length(ray) / kHazeM);
    return glm::mix(surface_colour(hit.slot, facing) * shade, kSky, haze);
  }

  glm::vec3 surface_colour(uint32_t slot, const glm::vec3& normal) const {
    for (size_t k = 0; k < slots_.size(); ++k)
      if (slots_[k] == slot) return 1.25f * to_vec(colour_of(k));
    if (scene_.mirror.instances()[slot].moving) return kMover;
    return normal.y > 0.9f ? kFloor : kStone;
  }

  enum class Cover : uint8_t { kNone, kHidden, kSeen };

  void outline(size_t k) {
    const Instance& target = scene_.mirror.instances()[slots_[k]];
    const PixelBox box = sphere_pixels(frame_.camera, frame_.lens, target.center_m, target.radius_m, picture_.width,
                                       picture_.height);
    const int width = box.x1 - box.x0, height = box.y1 - box.y0;
    std::vector<Cover> cover(static_cast<size_t>(width) * static_cast<size_t>(height));
    const auto cover_at = [&](int x, int y) {
      return x < 0 || y < 0 || x >= width || y >= height ? Cover::kNone : cover[static_cast<size_t>(y) * width + x];
    };
    // The box counts rows from the bottom, the picture from the top.
    const int top = picture_.height - box.y1;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        cover[static_cast<size_t>(y) * width + x] = cover_of(slots_[k], box.x0 + x, top + y);
    const Rgb colour = colour_of(k);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        if (cover_at(x, y) == Cover::kNone) continue;
        const bool edge = cover_at(x - 1, y) == Cover::kNone || cover_at(x + 1, y) == Cover::kNone ||
                          cover_at(x, y - 1) == Cover::kNone || cover_at(x, y + 1) == Cover::kNone;
        const bool hatch = cover_at(x, y) == Cover::kHidden && (x + y) % 4 == 0;
        if (edge || hatch) picture_.at(box.x0 + x, top + y) = colour;
      }
  }

  Cover cover_of(uint32_t slot, int x, int y) const {
    const glm::vec3 ray = direction(x + 0.5, y + 0.5);
    const float near = static_cast<float>(frame_.lens.near_m);
    const float infinity = std::numeric_limits<float>::infinity();
    RayFilter alone;
    alone.only_slot = slot;
    if (scene_.occluders.trace(frame_.camera.position_m, ray, near, infinity, alone).slot != slot) return Cover::kNone;
    const RayHit first = scene_.occluders.trace(frame_.camera.position_m, ray, near, infinity);
    return first.slot == slot ? Cover::kSeen : Cover::kHidden;
  }

  void caption() {
    PictureTruth truth = measure_picture(scene_.occluders, scene_.mirror, scene_.targets, frame_.camera, frame_.lens,
                                         kTruthSize / 4);
    add_outlines(scene_.occluders, scene_.mirror, scene_.targets, frame_.camera, frame_.lens, truth);
    char text[64];
    std::snprintf(text, sizeof text, "%.1f s", frame_.time_s);
    int x = write(4, text, {255, 255, 255});
    for (size_t k = 0; k < truth.targets.size(); ++k) {
      if (truth.targets[k].alone_pixels == 0)
        std::snprintf(text, sizeof text, "out");
      else
        std::snprintf(text, sizeof text, "%.0f %%", 100 * truth.targets[k].whole_share());
      x = write(x + 14, text, colour_of(k));
    }
  }

  // On a dark ground, so that it can be read over anything. Returns where it ends.
  int write(int x, const std::string& text, Rgb colour) {
    constexpr int kScale = 2;
    const int end = x + text_width(text, kScale);
    for (int row = 2; row < std::min(22, picture_.height); ++row)
      for (int column = std::max(0, x - 3); column < std::min(picture_.width, end + 1); ++column)
        picture_.at(column, row) = to_rgb(0.3f * to_vec(picture_.at(column, row)));
    draw_text(picture_, x, 4, kScale, text, colour);
    return end;
  }

  const DrawnScene& scene_;
  const CameraFrame& frame_;
  Picture picture_;
  std::vector<uint32_t> slots_;  // of the targets
};

}  // namespace

Picture draw_frame(ScenarioWorld& world, const CameraFrame& frame, int width) {
  world.set_time(frame.time_s);
  return draw_frame({world.mirror(), world.occluders(), world.targets()}, frame, width);
}

Picture draw_frame(const DrawnScene& scene, const CameraFrame& frame, int width) {
  return PanelPainter(scene, frame, width).paint();
}

Picture contact_sheet(ScenarioWorld& world, std::span<const CameraFrame> frames, const ContactSheetOptions& options) {
  constexpr int kGap = 4;
  const int panels = options.columns * options.rows;
  std::optional<Picture> sheet;
  for (int k = 0; k < panels; ++k) {
    const size_t at = panels == 1 ? 0 : (frames.size() - 1) * static_cast<size_t>(k) / static_cast<size_t>(panels - 1);
    const Picture panel = draw_frame(world, frames[at], options.panel_width);
    if (!sheet)
      sheet.emplace(options.columns * (panel.width + kGap) + kGap, options.rows * (panel.height + kGap) + kGap,
                    Rgb{24, 24, 28});
    paste(*sheet, panel, kGap + k % options.columns * (panel.width + kGap),
          kGap + k / options.columns * (panel.height + kGap));
  }
  return std::move(*sheet);
}

}  // namespace sightline
