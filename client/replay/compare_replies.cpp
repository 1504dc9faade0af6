#include "client/replay/compare_replies.h"

#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/scenario/scenario_session.h"
#include "server/base/hash.h"

namespace sightline {

const IgnoredFields& fields_beside_the_reply() {
  static const IgnoredFields fields = fields_named(
      {"sightline.v1.CameraReply.stage_times", "sightline.v1.StepFlags.recording_degraded"});
  return fields;
}

namespace {

IgnoredFields with(IgnoredFields fields, const IgnoredFields& more) {
  fields.insert(fields.end(), more.begin(), more.end());
  return fields;
}

}  // namespace

ReplyComparison::ReplyComparison(const Convention& convention, const IgnoredFields& unknown)
    : convention_(convention),
      unknown_(unknown),
      not_compared_(with(fields_beside_the_reply(), unknown)),
      plain_a_(unknown),
      plain_b_(unknown) {}

std::vector<std::string> ReplyComparison::unknown() const {
  std::vector<std::string> names;
  for (const google::protobuf::FieldDescriptor* field : unknown_) names.push_back(field->full_name());
  return names;
}

bool ReplyComparison::add(const v1::CameraReply& a, const v1::CameraReply& b) {
  const std::string &bytes_a = plain_a_.bytes_of(a), &bytes_b = plain_b_.bytes_of(b);
  const bool same = bytes_a == bytes_b;
  const bool hashes_same = hash_a_ == hash_b_;
  hash_a_ = hash64_bytes(std::as_bytes(std::span(bytes_a)), hash_a_);
  hash_b_ = same && hashes_same ? hash_a_ : hash64_bytes(std::as_bytes(std::span(bytes_b)), hash_b_);
  ++compared_;
  equal_ += same;
  if (!same) note(a, b);
  return same;
}

void ReplyComparison::note(const v1::CameraReply& a, const v1::CameraReply& b) {
  note_pose(a, b);
  for_each_difference(a, b, not_compared_, [&](const FieldDifference& difference) {
    if (!first_) first_ = {a.sequence(), a.time_s(), difference};
    FieldDeviation& deviation = deviations_[difference.general];
    if (deviation.replies == 0) deviation.first_sequence = a.sequence();
    // The elements of a list count once a reply.
    if (deviation.replies == 0 || deviation.last_sequence != a.sequence()) ++deviation.replies;
    deviation.field = difference.general;
    deviation.last_sequence = a.sequence();
    deviation.is_number |= difference.deviation.has_value();
    deviation.largest = std::max(deviation.largest, difference.deviation.value_or(0.0));
  });
}

void ReplyComparison::note_pose(const v1::CameraReply& a, const v1::CameraReply& b) {
  const Pose pose_a = camera_from_client(convention_, pose_from(a.pose()));
  const Pose pose_b = camera_from_client(convention_, pose_from(b.pose()));
  position_m_ = std::max(position_m_, glm::distance(pose_a.position_m, pose_b.position_m));
  direction_deg_ = std::max(direction_deg_, angle_between(pose_a.rotation, pose_b.rotation) * 180 / std::numbers::pi);
  for (const auto& target : a.targets())
    for (const auto& other : b.targets())
      if (target.id() == other.id())
        visible_share_ = std::max(visible_share_, std::abs(target.visible_share() - other.visible_share()));
}

std::vector<FieldDeviation> ReplyComparison::deviations() const {
  std::vector<FieldDeviation> all;
  for (const auto& [key, deviation] : deviations_) all.push_back(deviation);
  return all;
}

}  // namespace sightline
