#include "tests/sample/scene_maker.h"

namespace sightline::test {

glm::dvec3 SceneMaker::in_cube(double half_size_m) {
  const double x = random_.next_in(-half_size_m, half_size_m), y = random_.next_in(-half_size_m, half_size_m);
  return {x, y, random_.next_in(-half_size_m, half_size_m)};
}

std::shared_ptr<const Geometry> SceneMaker::shape() {
  const float a = static_cast<float>(random_.next_in(0.2, 1.5)), b = static_cast<float>(random_.next_in(0.2, 1.5)),
              c = static_cast<float>(random_.next_in(0.2, 1.5));
  Shape shape = BoxShape{{a, b, c}};
  switch (random_.next_below(4)) {
    case 1:
      shape = SphereShape{a};
      break;
    case 2:
      shape = CapsuleShape{a, b};
      break;
    case 3:
      shape = CylinderShape{a, b};
      break;
    default:
      break;
  }
  return build_geometry(tessellate(shape).value()).value();
}

Pose SceneMaker::pose() {
  glm::dquat q(0, 0, 0, 0);
  while (glm::length(q) < 0.1) q = glm::dquat(random_.next_in(-1, 1), in_cube(1.0));
  return {origin_m_ + in_cube(4.0), glm::normalize(q)};
}

glm::dmat3 SceneMaker::linear() {
  glm::dmat3 m(1.0);
  for (int axis = 0; axis < 3; ++axis) m[axis][axis] = random_.next_in(0.3, 2.0);
  if (random_.next_below(4) == 0) m[1][0] = random_.next_in(-0.7, 0.7);
  if (random_.next_below(4) == 0) m[2] = -m[2];
  return m;
}

InstanceAttributes SceneMaker::attributes() {
  InstanceAttributes out;
  out.layers = 1 + random_.next_below(7);
  if (random_.next_below(6) == 0) out.opacity = static_cast<float>(random_.next_in(0.5, 1.0));
  out.occludes = random_.next_below(12) != 0;
  out.collides = random_.next_below(12) != 0;
  out.visible = random_.next_below(12) != 0;
  return out;
}

NewInstance SceneMaker::instance(uint64_t id) {
  NewInstance out;
  out.id = id;
  out.geometry = shape();
  out.pose = pose();
  out.linear = linear();
  out.attributes = attributes();
  out.moving = random_.next_below(3) == 0;
  return out;
}

SceneDelta SceneMaker::scene(uint32_t count) {
  SceneDelta delta;
  for (uint32_t i = 0; i < count; ++i) delta.add.push_back(instance(i + 1));
  return delta;
}

MapView SceneMaker::view() {
  MapView view;
  const glm::dvec3 eye = in_cube(6.0), forward = glm::normalize(in_cube(3.0) - eye);
  view.eye_m = origin_m_ + eye;
  view.world_from_view = glm::mat3_cast(look_rotation(forward, in_cube(1.0), {1, 0, 0}));
  view.left = random_.next_in(-1.2, 0.2);
  view.right = view.left + random_.next_in(0.05, 2.0);
  view.bottom = random_.next_in(-1.2, 0.2);
  view.top = view.bottom + random_.next_in(0.05, 2.0);
  view.width = 5 + static_cast<int>(random_.next_below(28));
  view.height = 5 + static_cast<int>(random_.next_below(28));
  view.jitter = {random_.next_unit(), random_.next_unit()};
  return view;
}

std::vector<uint32_t> SceneMaker::ignored(size_t slot_count) {
  std::vector<uint32_t> slots;
  for (uint32_t slot = 0; slot < slot_count; ++slot)
    if (random_.next_below(5) == 0) slots.push_back(slot);
  return slots;
}

TransformUpdate SceneMaker::moves(const SceneMirror& mirror, uint32_t count) {
  TransformUpdate update;
  for (uint64_t id = 1; id <= count; ++id) {
    if (!mirror.find(id) || random_.next_below(2) == 0) continue;
    update.ids.push_back(id);
    update.poses.push_back(pose());
  }
  return update;
}

}  // namespace sightline::test
