// Replies of two runs against each other: how many are equal, where they part, and how far they come apart.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/replay/compare_messages.h"
#include "client/recordings/recording.h"
#include "server/session/convention.h"

namespace sightline {

// The one in which the poses of a session are; fails as opening the session would.
Result<Convention> convention_of(const v1::OpenSession& open);

// What no comparison of replies looks at: the times that stages took, and what a reply says of its recording.
const IgnoredFields& fields_beside_the_reply();

// A difference and the reply that it is in.
struct ReplyDifference {
  uint64_t sequence = 0;
  double time_s = 0.0;
  NamedDifference field;
};

struct FieldDeviation {
  std::string field;     // without the places in lists: "targets[].visible_share"
  uint64_t replies = 0;  // that differ in it
  double largest = 0.0;  // of numbers
  bool is_number = false;
  uint64_t first_sequence = 0, last_sequence = 0;  // of these replies
};

// Not thread-safe.
class ReplyComparison {
 public:
  explicit ReplyComparison(const Convention& convention) : convention_(convention) {}

  // Both answer the same tick. True: equal in all that counts, as reply_hash is.
  bool add(const v1::CameraReply& a, const v1::CameraReply& b);

  uint64_t compared() const { return compared_; }
  uint64_t equal() const { return equal_; }
  bool all_equal() const { return compared_ == equal_; }
  const std::optional<ReplyDifference>& first() const { return first_; }
  // Largest over all replies compared.
  double position_m() const { return position_m_; }
  double direction_deg() const { return direction_deg_; }  // between the rotations
  double visible_share() const { return visible_share_; }  // of any target in both
  // Every field that differed anywhere, in the order of their names.
  std::vector<FieldDeviation> deviations() const;
  // Of all replies so far, chained as reply_hash does.
  uint64_t hash_a() const { return hash_a_; }
  uint64_t hash_b() const { return hash_b_; }

 private:
  void note(const v1::CameraReply& a, const v1::CameraReply& b);
  void note_pose(const v1::CameraReply& a, const v1::CameraReply& b);

  const Convention convention_;
  PlainReply plain_a_, plain_b_;
  uint64_t compared_ = 0, equal_ = 0, hash_a_ = 0, hash_b_ = 0;
  std::optional<ReplyDifference> first_;
  double position_m_ = 0.0, direction_deg_ = 0.0, visible_share_ = 0.0;
  std::map<std::vector<const google::protobuf::FieldDescriptor*>, FieldDeviation> deviations_;
  std::vector<const google::protobuf::FieldDescriptor*> key_;
};

}  // namespace sightline
