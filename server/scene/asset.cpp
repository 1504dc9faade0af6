#include "server/scene/asset.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

using Interpolation = AssetChannel::Interpolation;

size_t width_of(const AssetChannel& channel) {
  return channel.path == AssetChannel::Path::kRotation ? 4 : 3;
}

// x, y, z (and w) of key `key`; `part` is 0 except in cubic splines: in-tangent 0, value 1, out-tangent 2.
glm::dvec4 value_at(const AssetChannel& channel, size_t key, size_t part) {
  const size_t width = width_of(channel);
  const size_t parts = channel.interpolation == Interpolation::kCubicSpline ? 3 : 1;
  const float* v = &channel.values[(key * parts + part) * width];
  return {v[0], v[1], v[2], width == 4 ? v[3] : 0.0f};
}

glm::dvec4 key_value(const AssetChannel& channel, size_t key) {
  return value_at(channel, key, channel.interpolation == Interpolation::kCubicSpline ? 1 : 0);
}

// Between unit quaternions the short way round; nearly equal ones are mixed straight, where sin(angle) is
// noise.
glm::dvec4 slerp(glm::dvec4 a, glm::dvec4 b, double s) {
  a = glm::normalize(a), b = glm::normalize(b);
  double cosine = glm::dot(a, b);
  if (cosine < 0.0) b = -b, cosine = -cosine;
  if (cosine > 1.0 - 1e-9) return a + (b - a) * s;
  const double angle = std::acos(cosine);
  return (std::sin((1.0 - s) * angle) * a + std::sin(s * angle) * b) / std::sin(angle);
}

// glTF 2.0 appendix C.5: Hermite, the tangents scaled by the length of the interval.
glm::dvec4 cubic(const AssetChannel& channel, size_t key, double s, double interval_s) {
  const double s2 = s * s, s3 = s2 * s;
  return (2.0 * s3 - 3.0 * s2 + 1.0) * value_at(channel, key, 1) +
         interval_s * (s3 - 2.0 * s2 + s) * value_at(channel, key, 2) +
         (-2.0 * s3 + 3.0 * s2) * value_at(channel, key + 1, 1) +
         interval_s * (s3 - s2) * value_at(channel, key + 1, 0);
}

glm::dvec4 sample(const AssetChannel& channel, double time_s) {
  const std::vector<float>& times = channel.times_s;
  if (!(time_s > times.front())) return key_value(channel, 0);
  if (time_s >= times.back()) return key_value(channel, times.size() - 1);
  const auto after = std::upper_bound(times.begin(), times.end(), time_s,
                                      [](double t, float key_time) { return t < static_cast<double>(key_time); });
  const auto key = static_cast<size_t>(after - times.begin()) - 1;
  const double interval_s = static_cast<double>(times[key + 1]) - static_cast<double>(times[key]);
  const double s = (time_s - static_cast<double>(times[key])) / interval_s;
  switch (channel.interpolation) {
    case Interpolation::kStep:
      return key_value(channel, key);
    case Interpolation::kCubicSpline:
      return cubic(channel, key, s, interval_s);
    case Interpolation::kLinear:
      break;
  }
  const glm::dvec4 a = key_value(channel, key), b = key_value(channel, key + 1);
  return channel.path == AssetChannel::Path::kRotation ? slerp(a, b, s) : a + (b - a) * s;
}

// The part of a node that animation can replace.
struct Placement {
  glm::dvec3 translation_m;
  glm::dquat rotation;
  glm::dvec3 scale;
  bool animated = false;
};

void apply(const AssetChannel& channel, double time_s, Placement& placement) {
  const glm::dvec4 v = sample(channel, time_s);
  placement.animated = true;
  switch (channel.path) {
    case AssetChannel::Path::kTranslation:
      placement.translation_m = glm::dvec3(v);
      break;
    case AssetChannel::Path::kScale:
      placement.scale = glm::dvec3(v);
      break;
    case AssetChannel::Path::kRotation: {
      // A cubic spline may pass through zero; there the rest rotation is as good as any.
      const double length = glm::length(v);
      if (length > 1e-9) placement.rotation = glm::dquat(v.w / length, v.x / length, v.y / length, v.z / length);
      break;
    }
  }
}

// Parents come before their children.
std::vector<Affine> to_world(const SceneAsset& asset, std::vector<Affine> parent_from_node) {
  for (size_t i = 0; i < asset.nodes.size(); ++i)
    if (const int parent = asset.nodes[i].parent; parent >= 0)
      parent_from_node[i] = compose(parent_from_node[static_cast<size_t>(parent)], parent_from_node[i]);
  return parent_from_node;
}

}  // namespace

size_t SceneAsset::triangle_count() const {
  size_t count = 0;
  for (const AssetNode& node : nodes)
    if (node.mesh >= 0 && meshes[static_cast<size_t>(node.mesh)])
      count += meshes[static_cast<size_t>(node.mesh)]->triangle_count() *
               std::max<size_t>(1, node.gpu_instances.size());
  return count;
}

std::vector<Affine> rest_world_from_node(const SceneAsset& asset) {
  std::vector<Affine> parent_from_node;
  parent_from_node.reserve(asset.nodes.size());
  for (const AssetNode& node : asset.nodes) parent_from_node.push_back(node.parent_from_node);
  return to_world(asset, std::move(parent_from_node));
}

std::vector<Affine> animated_world_from_node(const SceneAsset& asset, const AssetAnimation& animation, double time_s) {
  std::vector<Placement> placements;
  placements.reserve(asset.nodes.size());
  for (const AssetNode& node : asset.nodes) placements.push_back({node.translation_m, node.rotation, node.scale});
  for (const AssetChannel& channel : animation.channels)
    apply(channel, time_s, placements[static_cast<size_t>(channel.node)]);
  std::vector<Affine> parent_from_node;
  parent_from_node.reserve(asset.nodes.size());
  for (size_t i = 0; i < placements.size(); ++i) {
    const Placement& p = placements[i];
    parent_from_node.push_back(p.animated ? make_affine(p.translation_m, p.rotation, p.scale)
                                          : asset.nodes[i].parent_from_node);
  }
  return to_world(asset, std::move(parent_from_node));
}

}  // namespace sightline
