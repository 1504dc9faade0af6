#include "server/session/checks.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string_view>
#include <unordered_map>

#include "server/base/check.h"
#include "server/session/session.h"

namespace sightline {
namespace {

constexpr double kMinWeight = 1e-6, kMaxWeight = 1e6;
constexpr double kMinNearM = 1e-6, kMaxNearM = 10.0;
constexpr double kUnitTolerance = 1e-3;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

bool is_within(const glm::dvec3& p, double limit) {  // false for NaN
  return std::abs(p.x) <= limit && std::abs(p.y) <= limit && std::abs(p.z) <= limit;
}

Status check_known(const std::vector<uint64_t>& named, const IdsAfter& ids, const std::string& field) {
  for (size_t i = 0; i < named.size(); ++i)
    if (!ids.contains(named[i]))
      return fail(ErrorCode::kNotFound, indexed(field, i), "no instance has the id " + std::to_string(named[i]));
  return {};
}

// An offset in the frame of an instance, which exists, with the instance's scale.
glm::dvec3 scaled(const glm::dvec3& offset_m, uint64_t id, const IdsAfter& ids) {
  const NewInstance* added = ids.added(id);
  return (added ? added->linear : ids.staying(id)->linear) * offset_m;
}

Status check_target(const Target& target, const IdsAfter& ids, const std::string& field) {
  if (!ids.contains(target.instance_id))
    return fail(ErrorCode::kNotFound, field + ".id", "no instance has the id " + std::to_string(target.instance_id));
  const std::string weight = field + ".weight";
  if (Status ok = check_zero_or(weight.c_str(), target.weight, '[', kMinWeight, kMaxWeight, ']'); !ok) return ok;
  if (target.aim_offset_m && !is_within(scaled(*target.aim_offset_m, target.instance_id, ids), kMaxCoordinateM))
    return invalid(field + ".aim_offset", "each component must be finite and within 1e9 m, with the instance's scale");
  if (Status ok = check_known(target.attached_ids, ids, field + ".attached_ids"); !ok) return ok;
  if (Status ok = check_known(target.ignored_ids, ids, field + ".ignored_ids"); !ok) return ok;
  if (target.part_ids.size() > kMaxTargetParts)
    return fail(ErrorCode::kResourceExhausted, field + ".part_ids",
                "at most " + std::to_string(kMaxTargetParts) + " parts, got " + std::to_string(target.part_ids.size()));
  return check_known(target.part_ids, ids, field + ".part_ids");
}

// Every instance belongs to one body at most.
Status check_parts(const std::vector<Target>& targets, const std::string& list) {
  if (std::ranges::all_of(targets, [](const Target& target) { return target.part_ids.empty(); })) return {};
  std::unordered_map<uint64_t, size_t> target_of;  // by instance of a body
  for (size_t i = 0; i < targets.size(); ++i) target_of.emplace(targets[i].instance_id, i);
  for (size_t i = 0; i < targets.size(); ++i)
    for (size_t j = 0; j < targets[i].part_ids.size(); ++j) {
      const auto [known, is_new] = target_of.emplace(targets[i].part_ids[j], i);
      if (is_new) continue;
      const size_t of = known->second;
      const bool is_target = targets[of].instance_id == targets[i].part_ids[j];
      return invalid(indexed(indexed(list, i) + ".part_ids", j),
                     (is_target ? "is " : "is a part of ") + indexed(list, of) + " already");
    }
  return {};
}

// "poses[3].rotation" -> 3.
size_t index_in(const std::string& field) {
  return std::stoull(field.substr(field.find('[') + 1));
}

void replace_end(std::string& text, std::string_view end, std::string_view by) {
  if (text.ends_with(end)) text.replace(text.size() - end.size(), end.size(), by);
}

}  // namespace

IdsAfter::IdsAfter(const SceneMirror& mirror, const SceneDelta& delta) : mirror_(mirror), delta_(delta) {
  removed_.insert(delta.remove.begin(), delta.remove.end());
  for (size_t i = 0; i < delta.add.size(); ++i) added_.emplace(delta.add[i].id, i);
}

const Instance* IdsAfter::staying(uint64_t id) const {
  if (!removed_.empty() && removed_.contains(id)) return nullptr;
  return mirror_.find(id);
}

const NewInstance* IdsAfter::added(uint64_t id) const {
  if (added_.empty()) return nullptr;
  const auto it = added_.find(id);
  return it == added_.end() ? nullptr : &delta_.add[it->second];
}

Status check_targets(const std::vector<Target>& targets, const IdsAfter& ids, const std::string& list) {
  if (targets.size() > kMaxTargets)
    return fail(ErrorCode::kResourceExhausted, list,
                "at most " + std::to_string(kMaxTargets) + " targets, got " + std::to_string(targets.size()));
  for (size_t i = 0; i < targets.size(); ++i) {
    if (Status ok = check_target(targets[i], ids, indexed(list, i)); !ok) return ok;
    const auto same = [&](const Target& other) { return other.instance_id == targets[i].instance_id; };
    if (std::any_of(targets.begin(), targets.begin() + static_cast<ptrdiff_t>(i), same))
      return invalid(indexed(list, i) + ".id", "named twice");
  }
  return check_parts(targets, list);
}

bool is_unit(const glm::dquat& rotation) {
  return std::abs(glm::length(rotation) - 1.0) <= kUnitTolerance;
}

Status check_pose(const Pose& pose, const std::string& field) {
  if (!is_within(pose.position_m, kMaxCoordinateM))
    return invalid(field + ".position", "each coordinate must be finite and within 1e9 m of the world origin");
  if (is_unit(pose.rotation)) return {};
  return invalid(field + ".rotation",
                 "must have unit length within 1e-3, got length " + number(glm::length(pose.rotation)));
}

Status check_speed(const glm::dvec3& velocity_mps, const std::string& field) {
  const double speed = glm::length(velocity_mps);
  if (speed <= kMaxSentSpeedMps) return {};
  return invalid(field, "must be finite and at most 1e6 m/s, got " + number(speed) + " m/s");
}

Status check_turn(const glm::dvec3& angular_velocity_radps, const std::string& field) {
  const double speed = glm::length(angular_velocity_radps);
  if (speed <= kMaxSentTurnRadps) return {};
  return invalid(field, "must be finite and at most 1000 rad/s, got " + number(speed) + " rad/s");
}

Status check_lens(const Lens& lens, const std::string& field) {
  if (!(lens.vertical_fov_rad > kMinFovRad && lens.vertical_fov_rad < kMaxFovRad))
    return invalid(field + ".field_of_view", "must be in (0.01, 3) radians measured vertically, got " +
                                                 number(lens.vertical_fov_rad) + " radians");
  const std::string aspect = field + ".aspect", near = field + ".near_m";
  if (Status ok = check_range(aspect.c_str(), lens.aspect, 0.1, 10.0); !ok) return ok;
  return check_range(near.c_str(), lens.near_m, kMinNearM, kMaxNearM);
}

std::string client_field(const std::string& mirror_field) {
  const auto packed = [&](const char* array, size_t numbers) {
    return indexed(std::string("transforms.") + array, numbers * index_in(mirror_field));
  };
  if (mirror_field.starts_with("ids[")) return packed("ids", 1);
  if (mirror_field.starts_with("velocities_mps[")) return packed("velocities", 3);
  if (mirror_field.starts_with("angular_velocities_radps[")) return packed("angular_velocities", 3);
  if (mirror_field.starts_with("poses["))
    return mirror_field.ends_with("rotation") ? packed("rotations", 4) : packed("positions", 3);
  if (mirror_field == "poses") return "transforms.positions";
  if (mirror_field == "velocities_mps") return "transforms.velocities";
  if (mirror_field == "angular_velocities_radps") return "transforms.angular_velocities";
  std::string field = "delta." + mirror_field;
  for (const auto& [mirror, client] :
       {std::pair("delta.remove[", "delta.removed_ids["), std::pair("delta.add[", "delta.added_instances["),
        std::pair("delta.change[", "delta.changed_instances[")})
    if (field.starts_with(mirror)) field.replace(0, std::string_view(mirror).size(), client);
  replace_end(field, ".position_m", ".position");
  replace_end(field, ".linear", ".scale");
  return field;
}

}  // namespace sightline
