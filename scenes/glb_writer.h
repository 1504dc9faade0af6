// Writes binary glTF 2.0 (.glb): meshes shared between nodes, node transforms, extras, cameras, one
// animation. The same calls give the same bytes: no dates, no unordered containers.
#pragma once

#include <cstddef>
#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "server/scene/geometry.h"

namespace sightline::scenes {

// A node with its transform in its parent's frame.
struct GlbNode {
  std::string name;
  int parent = -1;  // an earlier node, or -1: a root
  int mesh = -1;    // from add_mesh
  int camera = -1;  // from add_camera
  glm::dvec3 translation_m{0.0};
  glm::dquat rotation{1.0, 0.0, 0.0, 0.0};
  nlohmann::ordered_json extras;  // left out when null
};

class GlbWriter {
 public:
  // `color` is the linear base colour of a plain material, each channel in [0, 1].
  int add_mesh(const std::string& name, const MeshData& mesh, const glm::vec3& color);
  int add_camera(double vertical_fov_rad, double aspect, double near_m);
  int add_node(const GlbNode& node);
  // Linear keys of one node's translation and rotation; times strictly increasing, in seconds. The three are
  // of one length, at least 1.
  void animate(int node, std::span<const float> times_s, std::span<const glm::vec3> translations_m,
               std::span<const glm::quat> rotations);

  // The whole file. `animation_name` names the animation that holds every key; no keys, no animation.
  std::vector<std::byte> finish(const std::string& animation_name) const;

 private:
  int add_view(std::span<const std::byte> bytes, int target);
  int add_accessor(std::span<const std::byte> bytes, int target, int component_type, const char* type, size_t count);
  int add_indices(const std::vector<uint32_t>& indices, size_t vertex_count);
  int add_times(std::span<const float> times_s);
  int add_material(const glm::vec3& color);

  std::vector<std::byte> binary_;
  nlohmann::ordered_json views_ = nlohmann::ordered_json::array();
  nlohmann::ordered_json accessors_ = nlohmann::ordered_json::array();
  nlohmann::ordered_json materials_ = nlohmann::ordered_json::array();
  nlohmann::ordered_json meshes_ = nlohmann::ordered_json::array();
  nlohmann::ordered_json cameras_ = nlohmann::ordered_json::array();
  nlohmann::ordered_json nodes_ = nlohmann::ordered_json::array();
  nlohmann::ordered_json roots_ = nlohmann::ordered_json::array();
  nlohmann::ordered_json samplers_ = nlohmann::ordered_json::array();
  nlohmann::ordered_json channels_ = nlohmann::ordered_json::array();
  std::vector<float> last_times_s_;  // of the accessor last_times_: nodes that share their times share the accessor
  int last_times_ = -1;
};

}  // namespace sightline::scenes
