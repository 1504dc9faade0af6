// The mirror: one session's copy of the game's scene. Geometry is shared; the mirror holds instances with
// client-chosen ids, moved each tick and added, hidden and removed while running.
//
// Revision counts structural deltas. The hash covers id, geometry, attributes and transform of every
// instance, is independent of the order in which they were added, and equal on two mirrors that were told the
// same things. Both go into every reply, so that drift between game and mirror cannot stay silent.
//
// The hash is the sum modulo 2^64, over all instances, of XXH3-64 (seed 0) of a record of 21 little-endian
// 64-bit words:
//   id | geometry hash high, low | opacity bits (float) << 32, layers | occludes, collides, visible as bits
//   0, 1, 2 | position x, y, z | rotation x, y, z, w | linear, column by column (9), all of these as double
//   bits.
// Velocities are not covered. An empty mirror has hash 0.
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

// Ids with this bit belong to the nodes of a loaded scene that the client did not bind: kAssetIdBit | k for
// the k-th drawable in file order (k counts from 0 and counts bound drawables too, so that it does not depend
// on the bindings). Client-chosen ids must be below it and not 0.
inline constexpr uint64_t kAssetIdBit = uint64_t{1} << 63;
inline constexpr size_t kMaxInstances = 1'000'000;

struct Instance {
  uint64_t id = 0;
  std::shared_ptr<const Geometry> geometry;  // null: a free slot
  Pose pose;                                 // world_from_instance without `linear`; unit rotation
  glm::dmat3 linear{1.0};  // applied before the pose: scale, or any linear map of an asset node
  Affine world_from_instance = identity_affine();
  glm::dvec3 velocity_mps{0.0};  // as last told by the client; zero when never told
  glm::dvec3 center_m{0.0};      // bounding sphere in the world
  double radius_m = 0.0;
  InstanceAttributes attributes;
  bool moving = false;  // has been moved since it was added

  bool occludes() const {
    return attributes.visible && attributes.occludes && attributes.opacity >= kOccludingOpacity;
  }
  bool collides() const { return attributes.visible && attributes.collides; }
};

// What an added instance starts as. Values must satisfy (else kInvalidArgument, and the field says which):
// geometry not null; pose finite, each coordinate within kMaxCoordinateM, |rotation| within 1e-3 of 1 (it is
// then normalised); is_valid_linear(linear); opacity in [0, 1].
// Where a moving instance's velocity takes it in `ahead_s` seconds; a static one stays.
glm::dvec3 travel_m(const Instance& instance, double ahead_s);
Affine world_from_instance_ahead(const Instance& instance, double ahead_s);

struct NewInstance {
  uint64_t id = 0;
  std::shared_ptr<const Geometry> geometry;
  Pose pose;
  glm::dmat3 linear{1.0};
  InstanceAttributes attributes;
  bool moving = false;
};

// Finite and invertible: no entry beyond 1e6, no column shorter than 1e-9, and a volume of at least 1e-9 of
// that of a box with edges as long as the columns.
bool is_valid_linear(const glm::dmat3& linear);

struct AttributeChange {
  uint64_t id = 0;
  InstanceAttributes attributes;
};

// One structural change, applied whole or not at all. Order: remove, add, change; so an id can be removed and
// added anew in one delta, and an instance that is added can be changed. No id may stand twice in one list.
struct SceneDelta {
  std::optional<uint64_t> base_revision;  // when given it must equal the mirror's revision
  std::vector<uint64_t> remove;
  std::vector<NewInstance> add;
  std::vector<AttributeChange> change;
  // Whether `add` may use asset ids: true only for what `instantiate` made. False refuses them, so a client
  // cannot take one; removing, changing and moving asset instances is open to clients either way.
  bool asset_ids_allowed = false;
  bool empty() const { return remove.empty() && add.empty() && change.empty(); }
};

// Poses of instances at one tick; parallel arrays, poses under the rules of NewInstance. velocities_mps is
// empty (what was told before stands) or as long as ids. No id may stand twice.
struct TransformUpdate {
  std::vector<uint64_t> ids;
  std::vector<Pose> poses;
  std::vector<glm::dvec3> velocities_mps;
};

// Single-threaded: owned by one session. Slots are stable while an instance lives and are reused after it is
// removed.
class SceneMirror {
 public:
  SceneMirror();
  SceneMirror(const SceneMirror&) = delete;  // a copy would share the identity
  SceneMirror& operator=(const SceneMirror&) = delete;

  // Checks everything, then applies everything: after an Error the mirror is as before. Fields and codes:
  //   "base_revision"                                   kFailedPrecondition: ask for a resync
  //   "remove[i]", "change[i].id", "ids[i]"             kNotFound; kInvalidArgument when named twice
  //   "add[i].id"                                       kAlreadyExists; kInvalidArgument: 0, an asset id,
  //   named twice "add[i].geometry" | ".pose.position_m" | ".pose.rotation" | ".linear" |
  //   ".attributes.opacity", "change[i].attributes.opacity"                    kInvalidArgument "add"
  //   kResourceExhausted: over kMaxInstances "poses", "velocities_mps" (lengths), "poses[i].position_m",
  //   "poses[i].rotation", "velocities_mps[i]"
  // A transform may name an instance that this delta adds, or one that is hidden. The first transform makes
  // an instance `moving`. With an empty delta and only moving instances, the cost is O(transforms) with no
  // allocation.
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
  // Changes whenever the set or attributes of moving instances change; their transforms may change at any
  // apply.
  uint64_t moving_version() const { return moving_version_; }
  // Slots of moving instances, hidden ones too, ascending.
  std::span<const uint32_t> moving_slots() const { return moving_slots_; }
  // Changes at every successful apply that changed anything.
  uint64_t version() const { return version_; }

 private:
  struct Pending;  // ids that a delta under check removes and adds

  Status check(const SceneDelta& delta, const TransformUpdate& transforms);
  Status check_structure(const SceneDelta& delta, Pending& pending) const;
  Status check_add(const NewInstance& instance, const std::string& field, bool asset_ids_allowed) const;
  Status check_transforms(const TransformUpdate& transforms, Pending& pending);
  bool will_exist(uint64_t id, const Pending& pending) const;

  void apply_structure(const SceneDelta& delta);
  void remove(uint64_t id);
  void add(const NewInstance& instance);
  void change(const AttributeChange& change);
  void move(uint32_t slot, const Pose& pose, const glm::dvec3* velocity_mps);
  void touch(const Instance& instance);
  void place(uint32_t slot);  // refreshes what follows from the transform, and the hash
  void refresh_hash(uint32_t slot);
  void tidy_moving_slots();

  const uint64_t identity_;
  uint64_t revision_ = 0;
  uint64_t hash_ = 0;
  uint64_t version_ = 0;
  uint64_t static_version_ = 0;
  uint64_t moving_version_ = 0;
  std::vector<Instance> slots_;
  std::vector<uint64_t> record_hashes_;  // by slot; 0 for a free one
  std::vector<uint64_t> named_in_;       // by slot: the last message whose transforms named it
  uint64_t message_ = 0;
  std::vector<uint32_t> free_slots_;
  std::vector<uint32_t> moving_slots_;
  bool moving_slots_untidy_ = false;
  std::unordered_map<uint64_t, uint32_t> slot_by_id_;
};

// Makes the node named `node_name` (its whole subtree, except subtrees bound by another binding) the instance
// `id`, so that the client can move it as one rigid body. The pose of the instance is the node's rest pose
// without scale: its world position, and the product of the rotations from the root down. Everything below it
// is merged into one geometry in that frame, scale and shear baked in.
//
// The instance has the attributes of the bound node. Of the nodes below it, hidden ones are left out and ones
// that do not occlude become see-through; their layers and whether they collide are not kept apart.
struct NodeBinding {
  std::string node_name;
  uint64_t id = 0;
};

// The instances of a scene file: one per binding in their order, then one per remaining drawable (each mesh
// node, or each of its gpu instances) with an asset id. A drawable flattened by a zero scale has it baked,
// and is left out when nothing remains. Apply them with SceneDelta::asset_ids_allowed. Fails with field
// "bindings[i].node" (kNotFound; kInvalidArgument when the name is not unique or bound twice, or the subtree
// has no triangles), "bindings[i].id" (kInvalidArgument: 0, an asset id, or used twice), or "asset"
// (kInvalidArgument: a node whose transform is not finite or beyond what NewInstance allows).
Result<std::vector<NewInstance>> instantiate(const SceneAsset& asset, std::span<const NodeBinding> bindings,
                                             GeometryStore& store);

}  // namespace sightline
