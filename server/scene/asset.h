// A scene file as data. The glTF reader makes it; mirrors and scenario players are built from it. Immutable and shared
// once loaded. Frame: glTF's own (the canonical one), metres.
#pragma once

#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/base/hash.h"
#include "server/base/transform.h"
#include "server/scene/geometry.h"

namespace sightline {

// How an instance takes part in visibility and collision (design 4).
struct InstanceAttributes {
  uint32_t layers = 1;   // bit set; a target's maps draw instances with (layers & target mask) != 0
  float opacity = 1.0f;  // [0, 1]; below kOccludingOpacity it does not occlude
  bool occludes = true;  // takes part in visibility
  bool collides = true;  // the camera body may not pass through it
  bool visible = true;   // false: hidden; neither occludes nor collides, keeps its id
  bool operator==(const InstanceAttributes&) const = default;
};

struct AssetNode {
  std::string name;
  int parent = -1;  // index into nodes; parents come before their children
  // Local transform. A matrix that consists of a rotation and a scale is decomposed. A sheared matrix is kept whole in
  // parent_from_node; such a node cannot be animated, and a warning says so.
  glm::dvec3 translation_m{0.0};
  glm::dquat rotation{1.0, 0.0, 0.0, 0.0};
  glm::dvec3 scale{1.0};
  Affine parent_from_node = identity_affine();
  bool decomposed = true;             // the three values above say the same as parent_from_node
  int mesh = -1;                      // index into meshes
  int camera = -1;                    // index into cameras
  std::vector<Affine> gpu_instances;  // EXT_mesh_gpu_instancing: node_from_instance of each; empty = one, identity
  InstanceAttributes attributes;      // from extras.sightline {layers, opacity, occludes, collides, visible}
  std::string extras_json;            // the node's `extras` as compact JSON; empty when absent
};

struct AssetCamera {
  double vertical_fov_rad = 0.0;
  std::optional<double> aspect;
  double near_m = 0.0;
};

struct AssetMaterial {
  std::string name;
  bool see_through = false;   // hides nothing; collides nevertheless
  bool double_sided = false;  // drawn from both sides. Here every surface hides from both
};

// One animated property of one node. Values stand 3 (translation, scale) or 4 (rotation x y z w) floats a key;
// cubic splines have three such values a key (in-tangent, value, out-tangent).
struct AssetChannel {
  enum class Path { kTranslation, kRotation, kScale };
  enum class Interpolation { kStep, kLinear, kCubicSpline };
  int node = -1;
  Path path = Path::kTranslation;
  Interpolation interpolation = Interpolation::kLinear;
  std::vector<float> times_s;  // strictly increasing
  std::vector<float> values;
};

struct AssetAnimation {
  std::string name;
  double duration_s = 0.0;
  std::vector<AssetChannel> channels;
};

struct SceneAsset {
  ContentHash hash;                                     // of the file's bytes and of every file it refers to
  std::vector<std::shared_ptr<const Geometry>> meshes;  // all primitives of a glTF mesh as one geometry; null if empty
  std::vector<std::string> mesh_names;
  std::vector<bool> mesh_double_sided;  // by mesh: the materials of all its primitives are
  std::vector<AssetMaterial> materials;
  std::vector<AssetNode> nodes;  // of the default scene, else of the first; of all roots when there are no scenes
  std::vector<AssetCamera> cameras;
  std::vector<AssetAnimation> animations;
  std::vector<std::string> extensions_used;
  std::vector<std::string> warnings;  // e.g. "skins[0]: drawn in rest pose"
  size_t triangle_count() const;      // as instanced: what a renderer would draw
};

// world_from_node of every node with its own local transform (the rest pose).
std::vector<Affine> rest_world_from_node(const SceneAsset& asset);
// The same with each animated property replaced by the sample of `animation` at `time_s` (clamped to the first and
// last key; glTF 2.0 section 3.11 and appendix C). `animation` may be any of asset.animations.
std::vector<Affine> animated_world_from_node(const SceneAsset& asset, const AssetAnimation& animation, double time_s);

}  // namespace sightline
