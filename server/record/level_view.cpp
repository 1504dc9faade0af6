#include "server/record/level_view.h"

#include <algorithm>
#include <set>
#include <vector>

namespace sightline {
namespace {

constexpr double kGrey[] = {0.72, 0.74, 0.78}, kOpacity = 1.0;

// Instances with a shape of the client are shown from its messages.
std::set<uint64_t> shaped_ids(const v1::OpenSession& open) {
  std::set<uint64_t> ids;
  for (const v1::NewInstance& instance : open.instances())
    if (instance.has_shape()) ids.insert(instance.id());
  return ids;
}

std::vector<const Instance*> largest_first(const SceneMirror& mirror, const std::set<uint64_t>& shaped) {
  std::vector<const Instance*> nodes;
  for (const Instance& instance : mirror.instances())
    if (instance.geometry && !shaped.contains(instance.id)) nodes.push_back(&instance);
  std::stable_sort(nodes.begin(), nodes.end(),
                   [](const Instance* a, const Instance* b) { return a->radius_m > b->radius_m; });
  return nodes;
}

void add_triangles(const Instance& instance, const Convention& viewer, uint64_t time_ns, foxglove::SceneUpdate& out) {
  foxglove::SceneEntity& entity = *out.add_entities();
  entity.mutable_timestamp()->set_seconds(static_cast<int64_t>(time_ns / 1'000'000'000));
  entity.mutable_timestamp()->set_nanos(static_cast<int32_t>(time_ns % 1'000'000'000));
  entity.set_frame_id(viewer_frame_of(instance.id));
  entity.set_id(entity.frame_id());
  entity.set_frame_locked(true);
  foxglove::TriangleListPrimitive& triangles = *entity.add_triangles();
  triangles.mutable_pose()->mutable_orientation()->set_w(1.0);
  foxglove::Color& colour = *triangles.mutable_color();
  colour.set_r(kGrey[0]), colour.set_g(kGrey[1]), colour.set_b(kGrey[2]), colour.set_a(kOpacity);
  for (const glm::vec3& position : instance.geometry->positions) {
    const glm::dvec3 p = vector_to_client(viewer, instance.linear * glm::dvec3(position));
    foxglove::Point3& point = *triangles.add_points();
    point.set_x(p.x), point.set_y(p.y), point.set_z(p.z);
  }
  triangles.mutable_indices()->Add(instance.geometry->indices.begin(), instance.geometry->indices.end());
}

}  // namespace

std::string viewer_frame_of(uint64_t id) {
  std::string frame = "instance/";
  return frame.append(std::to_string(id));
}

LevelView level_view_of(const SceneMirror& mirror, const Convention& convention, const v1::OpenSession& open,
                        uint64_t time_ns) {
  const Convention viewer = ros_convention();
  LevelView view;
  for (const Instance* instance : largest_first(mirror, shaped_ids(open))) {
    const Pose& pose = instance->pose;
    LevelNode& node = view.nodes[instance->id];
    node.rest = {position_to_client(viewer, pose.position_m + convention.origin_m),
                 rotation_to_client(viewer, pose.rotation)};
    node.linear = instance->linear;
    node.centre_m = glm::dvec3(instance->geometry->bounds.center());
    const uint64_t triangles = instance->geometry->triangle_count();
    if (view.triangles + triangles > LevelView::kMostTriangles) {
      view.left_out += triangles;
    } else if (instance->attributes.visible) {
      view.triangles += triangles;
      add_triangles(*instance, viewer, time_ns, view.shapes);
    }
  }
  for (const v1::NodeBinding& binding : open.scene().bindings())
    if (const auto node = view.nodes.find(binding.id()); node != view.nodes.end()) node->second.name = binding.node();
  return view;
}

}  // namespace sightline
