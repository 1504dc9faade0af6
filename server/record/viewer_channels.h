// Makes messages for ordinary viewers, with no plugin, from the messages of a session: Foxglove's well-known types.
//
// Every session uses the frame "world": metres, right-handed, +Z up (REP 103). Its x, y, z are z, x, y of the canonical
// frame, and the world origin is not subtracted. Frames below it: "camera" (+X forward, +Z up), "camera_optical" (+Z
// forward, +Y down, as CameraCalibration asks) and "instance/<id>".
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "server/record/level_view.h"
#include "server/record/record_topics.h"
#include "server/record/session_snapshot.h"
#include "server/session/convention.h"
#include "sightline/v1/camera_control.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// Shows what a SessionSnapshot knows: an instance moves in a viewer once a reply covers the tick that moved it.
//
// Not thread-safe. Shows at most kMaxInstances instances, those with the lowest ids.
class ViewerChannels {
 public:
  static constexpr size_t kMaxInstances = 4096;
  // Called with every message made, in the order of writing.
  using Emit = std::function<void(RecordTopic, const google::protobuf::MessageLite&)>;

  // `session` must outlive it, and must have taken each message before it comes here.
  explicit ViewerChannels(const SessionSnapshot& session) : session_(session) {}

  // A new session. A convention that cannot be read counts as glTF's. Makes nothing: emit_still() shows the instances.
  // `level` must outlive it; null: the scene file is not known, and only what the client sent is shown.
  void take_open(const v1::OpenSession& open, const LevelView* level = nullptr);
  void take_reply(const v1::CameraReply& reply, uint64_t time_ns, const Emit& emit);
  void take_rejection(const v1::TickError& rejection, uint64_t time_ns, const Emit& emit) const;
  void take_fault(const v1::Fault& fault, uint64_t time_ns, const Emit& emit) const;
  void take_gap(const v1::Gap& gap, uint64_t time_ns, const Emit& emit) const;
  // Shapes, and the frames of instances that never moved: for the head of a file.
  void emit_still(uint64_t time_ns, const Emit& emit);
  // The triangles of the scene file, after emit_still: for the head of a file too.
  void emit_level(uint64_t time_ns, const Emit& emit) const;

 private:
  template <typename Visit>  // (id, instance)
  void for_each_shown(Visit visit) const;
  Pose place_of(uint64_t id, const SessionSnapshot::Instance& instance) const;
  std::optional<Pose> place_of(uint64_t id) const;
  std::optional<glm::dvec3> aim_of(uint64_t id) const;
  const v1::Target* target_of(uint64_t id) const;
  std::string name_of(uint64_t id) const;
  bool was_removed(uint64_t id) const;
  bool is_at_rest(uint64_t id) const;
  void emit_removed(uint64_t time_ns, const Emit& emit) const;
  void take_lens(const v1::Lens& wire);
  void follow_shift();
  void emit_frames(const Pose& camera, uint64_t time_ns, const Emit& emit) const;
  void emit_sight(const v1::CameraReply& reply, const Pose& camera, uint64_t time_ns, const Emit& emit) const;
  void emit_calibration(const v1::CameraReply& reply, uint64_t time_ns, const Emit& emit) const;

  const SessionSnapshot& session_;
  const LevelView* level_ = nullptr;
  v1::TargetList first_targets_;  // of the opening
  Convention client_ = gltf_convention();
  double aspect_ = 16.0 / 9.0;
  uint64_t shown_deltas_ = 0;  // of the session, when the still instances were shown last
  v1::TrackingStatus last_status_ = v1::TRACKING_STATUS_UNSPECIFIED;
  v1::MoveReason last_reason_ = v1::MOVE_REASON_UNSPECIFIED;
};

}  // namespace sightline
