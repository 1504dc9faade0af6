#include "tests/scenes/hidden.h"

#include "server/sample/embree_scene.h"
#include "tests/scenes/stage.h"

namespace sightline {
namespace {

constexpr double kFrame_s = 1.0 / 15.0;

glm::dvec3 middle_of_targets(const Stage& stage, double time_s) {
  const std::vector<Role> targets = stage.with_role("target");
  glm::dvec3 sum{0.0};
  for (const Role& role : targets) sum += stage.pose_of(role, time_s).position_m;
  return sum / static_cast<double>(targets.size());
}

}  // namespace

Hidden hidden_from_fixed_offset(std::span<const std::byte> bytes, bool turning) {
  Stage stage(bytes);
  EmbreeDevice device;
  EmbreeScene occluders(device, EmbreeScene::Content::kOccluders);
  const std::vector<Role> targets = stage.with_role("target");
  const glm::dvec3 offset = stage.pose_of(stage.with_role("camera")[0], 0).position_m - middle_of_targets(stage, 0);
  const glm::dquat first = stage.pose_of(targets[0], 0).rotation;
  int frames = 0, any = 0, all = 0;
  for (double time_s = 0; time_s <= stage.duration_s(); time_s += kFrame_s, ++frames) {
    stage.play(time_s);
    occluders.take_in(stage.mirror());
    const std::vector<uint32_t> ignored = stage.target_slots();
    const glm::dquat turn = stage.pose_of(targets[0], time_s).rotation * glm::conjugate(first);
    const glm::dvec3 eye = middle_of_targets(stage, time_s) + (turning ? turn * offset : offset);
    size_t hidden = 0;
    for (const Role& role : targets) {
      const glm::dvec3 chest = stage.pose_of(role, time_s).position_m + glm::dvec3(0, 0.9, 0);
      hidden += occluders.trace(eye, glm::vec3(chest - eye), 0, 1, {.ignored_slots = ignored}).slot != UINT32_MAX;
    }
    any += hidden > 0;
    all += hidden == targets.size();
  }
  return {static_cast<double>(any) / frames, static_cast<double>(all) / frames};
}

}  // namespace sightline
