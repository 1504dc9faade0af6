// The mirror: one session's copy of the game's scene. It holds instances with ids that the client chooses. Instances
// move each tick and can be added, hidden and removed at any time; their geometry is shared between mirrors.
//
// The revision counts structural deltas. The hash covers id, geometry, attributes and transform of every instance, in
// any order: two mirrors that received the same data have the same hash. Every reply carries both, so that a game
// notices when its scene and the mirror differ.
//
// The hash is the sum modulo 2^64, over all instances, of XXH3-64 (seed 0) of a record of 21 little-endian 64-bit
// words:
//   id | geometry hash high, low | opacity bits (float) << 32, layers | occludes, collides, visible as bits 0, 1, 2 |
//   position x, y, z | rotation x, y, z, w | linear, column by column (9); the last 16 words are the bits of doubles.
// Velocities are not covered. An empty mirror has hash 0.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "server/base/error.h"
#include "server/base/transform.h"
#include "server/scene/asset.h"
#include "server/scene/geometry.h"

namespace sightline {

// Ids with this bit belong to the nodes of a loaded scene that the client did not bind. The k-th drawable in file
// order, from 0, has the id kAssetIdBit | k. The count includes bound drawables, so that it does not depend on the
// bindings. Ids that the client chooses must be below this bit and not 0.
inline constexpr uint64_t kAssetIdBit = uint64_t{1} << 63;
inline constexpr size_t kMaxInstances = 1'000'000;

struct Instance {
  uint64_t id = 0;
  std::shared_ptr<const Geometry> geometry;  // null when the slot is free
  // world_from_instance without `linear`, as the client sent it; unit rotation
  Pose pose;
  // from the position that was sent to the one that is believed (session/motion_track.h); world
  glm::dvec3 correction_m{0.0};
  glm::dmat3 linear{1.0};  // applied before the pose: scale, or any linear map of an asset node
  Affine world_from_instance = identity_affine();
  glm::dvec3 velocity_mps{0.0};            // the last value that was given; zero before the first
  glm::dvec3 angular_velocity_radps{0.0};  // the same, about the origin of the instance; world axes
  glm::dvec3 center_m{0.0};                // bounding sphere in the world
  double radius_m = 0.0;
  InstanceAttributes attributes;
  bool moving = false;  // has been moved since it was added

  bool occludes() const { return attributes.visible && attributes.occludes && attributes.opacity >= kOccludingOpacity; }
  bool collides() const { return attributes.visible && attributes.collides; }
};

// The pose as it is believed: `pose` with the correction.
Pose believed_pose(const Instance& instance);
// The displacement of a moving instance after `ahead_s` seconds at its velocity; zero for a static one.
glm::dvec3 travel_m(const Instance& instance, double ahead_s);
// True for a moving instance that turns by itself.
bool turns(const Instance& instance);
// world_from_instance of a moving instance displaced by travel_m, and turned by its angular velocity about its own
// origin.
Affine world_from_instance_ahead(const Instance& instance, double ahead_s);
// The centre of its bounding sphere then.
glm::dvec3 center_ahead_m(const Instance& instance, double ahead_s);

// An instance to be added. Requirements (otherwise kInvalidArgument with the field): geometry is not null; the pose is
// finite, with each coordinate within kMaxCoordinateM and |rotation| within 1e-3 of 1 (the mirror normalises it);
// is_valid_linear(linear), and with it the geometry lies within kMaxCoordinateM of the instance's origin; opacity is in
// [0, 1].
struct NewInstance {
  uint64_t id = 0;
  std::shared_ptr<const Geometry> geometry;
  Pose pose;
  glm::dmat3 linear{1.0};
  InstanceAttributes attributes;
  bool moving = false;
};

// True when the map is finite and invertible. No entry may exceed 1e6, and none of the inverse 1e8. The volume must be
// at least 1e-9 of the volume of a box whose edges are as long as the columns.
bool is_valid_linear(const glm::dmat3& linear);

struct AttributeChange {
  uint64_t id = 0;
  InstanceAttributes attributes;
};

// One structural change, applied whole or not at all, in the order remove, add, change. So one delta can replace an
// instance under its id, and change an instance that it adds. No id may occur twice in one list.
struct SceneDelta {
  std::optional<uint64_t> base_revision;  // must equal the mirror's revision when given
  std::vector<uint64_t> remove;
  std::vector<NewInstance> add;
  std::vector<AttributeChange> change;
  // Allows asset ids in `add`: true only for the instances that `instantiate` made. Clients may remove, change and move
  // asset instances, but not add them.
  bool asset_ids_allowed = false;
  bool empty() const { return remove.empty() && add.empty() && change.empty(); }
};

// Poses of instances at one tick, as parallel arrays. Poses follow the rules of NewInstance. `velocities_mps` and
// `angular_velocities_radps` are empty (they stay as they were) or as long as `ids`. So is `corrections_m`; without it
// there are none. No id may occur twice.
struct TransformUpdate {
  std::vector<uint64_t> ids;
  std::vector<Pose> poses;
  std::vector<glm::dvec3> velocities_mps;
  std::vector<glm::dvec3> angular_velocities_radps;
  std::vector<glm::dvec3> corrections_m;
};

// Not thread-safe; owned by one session. An instance keeps its slot while it exists; the slot is reused after it is
// removed.
class SceneMirror {
 public:
  SceneMirror();
  SceneMirror(const SceneMirror&) = delete;  // a copy would share the identity
  SceneMirror& operator=(const SceneMirror&) = delete;

  // Checks everything, then applies everything: after an Error the mirror is unchanged. Fields and codes:
  //   "base_revision"                          kFailedPrecondition: ask for a resync
  //   "remove[i]", "change[i].id", "ids[i]"    kNotFound; kInvalidArgument when named twice
  //   "add[i].id"                              kAlreadyExists; kInvalidArgument for 0, an asset id, or an id named
  //   twice "add[i].geometry", ".pose.position_m", ".pose.rotation", ".linear" and ".attributes.opacity",
  //   "change[i].attributes.opacity"           kInvalidArgument
  //   "add"                                    kResourceExhausted: more than kMaxInstances
  //   "poses", "velocities_mps", "angular_velocities_radps" and "corrections_m" (lengths), "poses[i].position_m",
  //   "poses[i].rotation", "velocities_mps[i]", "angular_velocities_radps[i]"  kInvalidArgument
  // A transform may name an instance that this delta adds, or a hidden one. An instance becomes `moving` with its first
  // transform. With an empty delta and only moving instances the cost is O(transforms) without allocation.
  Status apply(const SceneDelta& delta, const TransformUpdate& transforms);

  uint64_t revision() const { return revision_; }
  uint64_t hash() const { return hash_; }

  // Slot i is instances()[i]; free slots have a null geometry. Valid until the next apply.
  std::span<const Instance> instances() const { return slots_; }
  std::optional<uint32_t> slot_of(uint64_t id) const;
  const Instance* find(uint64_t id) const;
  size_t size() const { return slot_by_id_.size(); }

  // Unique in the process; samplers use it as the key of their caches.
  uint64_t identity() const { return identity_; }
  // Changes whenever the set, attributes or transforms of the instances that are not `moving` change.
  uint64_t static_version() const { return static_version_; }
  // Changes whenever the set or attributes of moving instances change; their transforms may change in any call of
  // apply.
  uint64_t moving_version() const { return moving_version_; }
  // Slots of moving instances, including hidden ones, ascending.
  std::span<const uint32_t> moving_slots() const { return moving_slots_; }
  // Changes in every call of apply that changes anything.
  uint64_t version() const { return version_; }

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)
  struct Pending;             // ids that the delta being checked removes and adds

  Status check(const SceneDelta& delta, const TransformUpdate& transforms);
  Status check_structure(const SceneDelta& delta, Pending& pending) const;
  Status check_add(const NewInstance& instance, const std::string& field, bool asset_ids_allowed) const;
  Status check_transforms(const TransformUpdate& transforms, Pending& pending);
  bool will_exist(uint64_t id, const Pending& pending) const;

  void apply_structure(const SceneDelta& delta);
  void remove(uint64_t id);
  void add(const NewInstance& instance);
  void change(const AttributeChange& change);
  void move(uint32_t slot, const TransformUpdate& transforms, size_t i);
  void touch(const Instance& instance);
  void place(uint32_t slot);  // updates bounds and hash after a change of the transform
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
  std::vector<uint64_t> named_in_;       // by slot: the last message whose transforms named the instance
  uint64_t message_ = 0;
  std::vector<uint32_t> free_slots_;
  std::set<uint32_t> rearranged_slots_;  // whose instance is not the one of the first delta
  std::vector<uint32_t> moving_slots_;
  bool moving_slots_untidy_ = false;
  std::unordered_map<uint64_t, uint32_t> slot_by_id_;
};

// Makes the node `node_name` and its subtree the instance `id`, so that the client can move it as one rigid body.
// Subtrees of other bindings are left out. The pose of the instance is the node's rest pose without scale: its world
// position, and the product of the rotations from the root down. The subtree is merged into one geometry in that frame,
// with scale and shear applied.
//
// The instance has the attributes of the bound node. Hidden nodes below it are left out, and nodes that do not occlude
// become see-through; the layers and `collides` of nodes below are ignored.
struct NodeBinding {
  std::string node_name;
  uint64_t id = 0;
};

// The instances of a scene file. First comes one for each binding, in order, then one with an asset id for each
// remaining drawable (a mesh node, or one of its GPU instances). When a zero scale flattens a drawable, the scale is
// applied to its geometry; a drawable without triangles left is left out. Apply the result with
// SceneDelta::asset_ids_allowed. Fails with field "bindings[i].node" (kNotFound; kInvalidArgument when the name is not
// unique or bound twice, or the subtree has no triangles), "bindings[i].id" (kInvalidArgument: 0, an asset id, or used
// twice), or "asset" (kInvalidArgument: a node whose transform is not finite or breaks the rules of NewInstance).
Result<std::vector<NewInstance>> instantiate(const SceneAsset& asset, std::span<const NodeBinding> bindings,
                                             GeometryStore& store);

}  // namespace sightline
