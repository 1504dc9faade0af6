// The checks that a session makes before it changes anything. Errors name the fields of the client's messages.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "server/base/camera.h"
#include "server/base/error.h"
#include "server/scene/mirror.h"
#include "server/scene/target.h"

namespace sightline {

// The instances that will exist after a delta. Refers to the mirror and the delta; free when the delta is empty.
class IdsAfter {
 public:
  IdsAfter(const SceneMirror& mirror, const SceneDelta& delta);

  bool contains(uint64_t id) const { return added(id) != nullptr || staying(id) != nullptr; }
  // The instance as it is now; null if the delta removes or replaces it, or if it does not exist.
  const Instance* staying(uint64_t id) const;
  // The instance that the delta adds under this id, else null.
  const NewInstance* added(uint64_t id) const;

 private:
  const SceneMirror& mirror_;
  const SceneDelta& delta_;
  std::unordered_set<uint64_t> removed_;
  std::unordered_map<uint64_t, size_t> added_;
};

// Fields "<list>" (more than kMaxTargets), "<list>[i].id" (unknown, or named twice), ".weight",
// ".aim_offset",
// ".attached_ids[j]" and ".ignored_ids[j]" (unknown: they must exist when they are named, and may be removed later),
// ".part_ids" (more than kMaxTargetParts) and ".part_ids[j]" (unknown, by the same rule; a target; or a part that was
// named before).
Status check_targets(const std::vector<Target>& targets, const IdsAfter& ids, const std::string& list);

// A rotation's length is within 1e-3 of 1; false for NaN.
bool is_unit(const glm::dquat& rotation);
// Fields "<field>.position" and "<field>.rotation".
Status check_pose(const Pose& pose, const std::string& field);
// Refuses speeds over kMaxSentSpeedMps.
Status check_speed(const glm::dvec3& velocity_mps, const std::string& field);
// Refuses angular speeds over kMaxSentTurnRadps.
Status check_turn(const glm::dvec3& angular_velocity_radps, const std::string& field);
// Ranges of server/base/camera.h; fields "<field>.field_of_view", ".aspect", ".near_m".
Status check_lens(const Lens& lens, const std::string& field);

// Translates the mirror's fields to the client's: "ids[3]" -> "transforms.ids[3]", "poses[3].rotation" ->
// "transforms.rotations[12]" (packed arrays count numbers), "add[1].linear" -> "delta.added_instances[1].scale".
std::string client_field(const std::string& mirror_field);

}  // namespace sightline
