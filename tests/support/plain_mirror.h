// A second, plain mirror of a scene, for comparison: a map of records without slots, caches or increments. It follows
// the rules of server/scene/mirror.h. It shares no code with it but the algebra library and XXH3.
#pragma once

#include <xxhash.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <set>

#include "server/scene/mirror.h"

namespace sightline::test {

class PlainMirror {
 public:
  uint64_t revision() const { return revision_; }
  size_t size() const { return records_.size(); }
  uint64_t hash() const {
    uint64_t sum = 0;
    for (const auto& [id, record] : records_) sum += hash_of(id, record);
    return sum;
  }
  const std::map<uint64_t, NewInstance>& records() const { return records_; }

  // False: the change breaks a rule, and nothing has changed.
  bool apply(const SceneDelta& delta, const TransformUpdate& transforms) {
    if (delta.base_revision && *delta.base_revision != revision_) return false;
    std::map<uint64_t, NewInstance> next = records_;
    if (!restructure(delta, next) || !move(transforms, next)) return false;
    records_ = std::move(next);
    revision_ += !delta.empty();
    return true;
  }

 private:
  using Records = std::map<uint64_t, NewInstance>;

  static bool restructure(const SceneDelta& delta, Records& next) {
    for (const uint64_t id : delta.remove)
      if (next.erase(id) == 0) return false;
    for (const sightline::NewInstance& added : delta.add) {
      const bool own_id = added.id != 0 && (added.id >> 63 == 0 || delta.asset_ids_allowed);
      if (!own_id || !added.geometry || !is_pose(added.pose) || !is_linear(added.linear) ||
          !is_share(added.attributes.opacity))
        return false;
      if (!next.emplace(added.id, added).second) return false;
      next[added.id].pose.rotation = glm::normalize(added.pose.rotation);
    }
    std::set<uint64_t> changed;
    for (const AttributeChange& change : delta.change) {
      const auto record = next.find(change.id);
      if (record == next.end() || !changed.insert(change.id).second || !is_share(change.attributes.opacity))
        return false;
      record->second.attributes = change.attributes;
    }
    return next.size() <= 1'000'000;
  }

  static bool move(const TransformUpdate& transforms, Records& next) {
    const size_t count = transforms.ids.size();
    if (transforms.poses.size() != count ||
        (!transforms.velocities_mps.empty() && transforms.velocities_mps.size() != count))
      return false;
    std::set<uint64_t> moved;
    for (size_t i = 0; i < count; ++i) {
      const auto record = next.find(transforms.ids[i]);
      if (record == next.end() || !moved.insert(transforms.ids[i]).second || !is_pose(transforms.poses[i]))
        return false;
      record->second.pose = {transforms.poses[i].position_m, glm::normalize(transforms.poses[i].rotation)};
    }
    for (const glm::dvec3& velocity : transforms.velocities_mps)
      for (int axis = 0; axis < 3; ++axis)
        if (!std::isfinite(velocity[axis])) return false;
    return true;
  }

  static bool is_share(float value) { return value >= 0 && value <= 1; }
  static bool is_pose(const Pose& pose) {
    for (int axis = 0; axis < 3; ++axis)
      if (!(std::fabs(pose.position_m[axis]) <= 1e9)) return false;
    const glm::dquat& q = pose.rotation;
    return std::fabs(glm::length(q) - 1) <= 1e-3;
  }
  static bool is_linear(const glm::dmat3& m) {
    double box = 1;
    for (int column = 0; column < 3; ++column) {
      for (int row = 0; row < 3; ++row)
        if (!(std::fabs(m[column][row]) <= 1e6)) return false;
      if (glm::length(m[column]) < 1e-9) return false;
      box *= glm::length(m[column]);
    }
    return std::fabs(glm::determinant(m)) > 1e-9 * box;
  }

  static uint64_t hash_of(uint64_t id, const NewInstance& record) {
    unsigned char bytes[21 * 8];
    unsigned char* at = bytes;
    const auto put = [&](auto value) { std::memcpy(at, &value, sizeof value), at += sizeof value; };
    const InstanceAttributes& a = record.attributes;
    put(id), put(uint64_t{record.geometry->hash.high}), put(uint64_t{record.geometry->hash.low});
    put(a.layers), put(a.opacity);  // low half, high half
    put(uint64_t{a.occludes} + 2 * uint64_t{a.collides} + 4 * uint64_t{a.visible});
    for (int axis = 0; axis < 3; ++axis) put(record.pose.position_m[axis]);
    put(record.pose.rotation.x), put(record.pose.rotation.y), put(record.pose.rotation.z), put(record.pose.rotation.w);
    for (int column = 0; column < 3; ++column)
      for (int row = 0; row < 3; ++row) put(record.linear[column][row]);
    return XXH3_64bits(bytes, sizeof bytes);
  }

  uint64_t revision_ = 0;
  Records records_;
};

}  // namespace sightline::test
