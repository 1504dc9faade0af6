// Compares the replies of two runs: how many are equal, where the first difference is, and how large differences are.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/recordings/recording.h"
#include "client/replay/compare_messages.h"
#include "server/session/convention.h"

namespace sightline {

// The fields that no comparison of replies counts: stage times, and the flag about the recording.
const IgnoredFields& fields_beside_the_reply();

// A difference, and the message that it is in.
struct ReplyDifference {
  uint64_t sequence = 0;
  double time_s = 0.0;
  FieldDifference field;
};

struct FieldDeviation {
  std::string field;     // without indices: "targets[].visible_share"
  uint64_t replies = 0;  // that differ in it
  double largest = 0.0;  // of numbers
  bool is_number = false;
  uint64_t first_sequence = 0, last_sequence = 0;  // of those replies
};

// Not thread-safe.
class ReplyComparison {
 public:
  // `unknown`: fields that a server of one side did not know yet. They do not count, and the hashes do not cover them.
  explicit ReplyComparison(const Convention& convention, const IgnoredFields& unknown = {});

  // Both must answer the same tick. Returns true when they are equal, as reply_hash is.
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
  // The full names of the unknown fields, in the order of the contract.
  std::vector<std::string> unknown() const;
  // Chained hashes of all replies so far, as of reply_hash.
  uint64_t hash_a() const { return hash_a_; }
  uint64_t hash_b() const { return hash_b_; }

 private:
  void note(const v1::CameraReply& a, const v1::CameraReply& b);
  void note_pose(const v1::CameraReply& a, const v1::CameraReply& b);

  const Convention convention_;
  const IgnoredFields unknown_, not_compared_;  // the latter includes fields_beside_the_reply
  PlainReply plain_a_, plain_b_;
  uint64_t compared_ = 0, equal_ = 0, hash_a_ = 0, hash_b_ = 0;
  std::optional<ReplyDifference> first_;
  double position_m_ = 0.0, direction_deg_ = 0.0, visible_share_ = 0.0;
  std::map<std::string, FieldDeviation> deviations_;  // by name
};

}  // namespace sightline
