// The mirror: one session's copy of the game's scene. Geometry is shared; the mirror holds instances with
// client-chosen ids, moved each tick and added, hidden and removed while running.
//
// Revision counts structural deltas. The hash covers id, geometry, attributes and transform of every instance, is
// independent of the order in which they were added, and equal on two mirrors that were told the same things. Both go
// into every reply, so that drift between game and mirror cannot stay silent.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "server/base/error.h"
#include "server/base/transform.h"
#include "server/scene/asset.h"
#include "server/scene/geometry.h"

namespace sightline {

// Ids with this bit belong to the nodes of a loaded scene that the client did not bind: kAssetIdBit | k for the k-th
// drawable in file order. Client-chosen ids must be below it and not 0.
inline constexpr uint64_t kAssetIdBit = uint64_t{1} << 63;
inline constexpr size_t kMaxInstances = 1'000'000;

struct Instance {
  uint64_t id = 0;
  std::shared_ptr<const Geometry> geometry;  // null: a free slot
  Pose pose;                                 // world_from_instance without `linear`
  glm::dmat3 linear{1.0};                    // applied before the pose: scale, or any linear map of an asset node
  Affine world_from_instance = identity_affine();
  glm::dvec3 velocity_mps{0.0};              // as told by the client; zero when never told
  glm::dvec3 center_m{0.0};                  // bounding sphere in the world
  double radius_m = 0.0;
  InstanceAttributes attributes;
  bool moving = false;                       // has been moved since it was added

  bool occludes() const {
    return attributes.visible && attributes.occludes && attributes.opacity >= kOccludingOpacity;
  }
  bool collides() const { return attributes.visible && attributes.collides; }
};

struct NewInstance {
  uint64_t id = 0;
  std::shared_ptr<const Geometry> geometry;
  Pose pose;
  glm::dmat3 linear{1.0};
  InstanceAttributes attributes;
  bool moving = false;
};

struct AttributeChange {
  uint64_t id = 0;
  InstanceAttributes attributes;
};

// One structural change, applied whole or not at all. Order: remove, add, change.
struct SceneDelta {
  std::optional<uint64_t> base_revision;  // when given it must equal the mirror's revision
  std::vector<uint64_t> remove;
  std::vector<NewInstance> add;
  std::vector<AttributeChange> change;
  bool empty() const { return remove.empty() && add.empty() && change.empty(); }
};

// Poses of instances at one tick; parallel arrays. velocities_mps is empty or as long as ids.
struct TransformUpdate {
  std::vector<uint64_t> ids;
  std::vector<Pose> poses;
  std::vector<glm::dvec3> velocities_mps;
};

// Single-threaded: owned by one session. Slots are stable while an instance lives and are reused after it is removed.
class SceneMirror {
 public:
  SceneMirror();

  // Checks everything, then applies everything: after an Error the mirror is as before. Fields: "remove[i]",
  // "add[i].id", "change[i].id", "base_revision" (kFailedPrecondition: ask for a resync), "ids[i]" for transforms.
  // A transform may name an instance that this delta adds.
  Status apply(const SceneDelta& delta, const TransformUpdate& transforms);

  uint64_t revision() const { return revision_; }
  uint64_t hash() const { return hash_; }

  // Slot i is instances()[i]; free slots have a null geometry. Valid until the next apply.
  std::span<const Instance> instances() const { return slots_; }
  std::optional<uint32_t> slot_of(uint64_t id) const;
  const Instance* find(uint64_t id) const;
  size_t size() const { return slot_by_id_.size(); }

  // Unique in the process; samplers key their caches by it.
  uint64_t identity() const { return identity_; }
  // Changes whenever the set, attributes or transforms of the instances that are not `moving` change.
  uint64_t static_version() const { return static_version_; }
  // Changes whenever the set or attributes of moving instances change; their transforms may change at any apply.
  uint64_t moving_version() const { return moving_version_; }
  // Slots of moving instances, ascending.
  std::span<const uint32_t> moving_slots() const { return moving_slots_; }
  // Changes at every successful apply that changed anything.
  uint64_t version() const { return version_; }

 private:
  Status check(const SceneDelta& delta, const TransformUpdate& transforms) const;
  void remove(uint64_t id);
  void add(const NewInstance& instance);
  void change(const AttributeChange& change);
  void move(uint64_t id, const Pose& pose, const glm::dvec3* velocity_mps);
  void touch(const Instance& instance);

  const uint64_t identity_;
  uint64_t revision_ = 0;
  uint64_t hash_ = 0;
  uint64_t version_ = 0;
  uint64_t static_version_ = 0;
  uint64_t moving_version_ = 0;
  std::vector<Instance> slots_;
  std::vector<uint32_t> free_slots_;
  std::vector<uint32_t> moving_slots_;
  std::unordered_map<uint64_t, uint32_t> slot_by_id_;
};

// Makes the node named `node_name` (its whole subtree, except subtrees bound by another binding) the instance `id`,
// so that the client can move it as one rigid body. The pose of the instance is the node's rest pose without scale.
struct NodeBinding {
  std::string node_name;
  uint64_t id = 0;
};

// The instances of a scene file: one per binding, and one per remaining drawable with an asset id. Fails with field
// "bindings[i].node" (kNotFound; kInvalidArgument when the name is not unique or the subtree has no triangles) or
// "bindings[i].id".
Result<std::vector<NewInstance>> instantiate(const SceneAsset& asset, std::span<const NodeBinding> bindings,
                                             GeometryStore& store);

}  // namespace sightline
