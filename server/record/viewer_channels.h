// What a recording shows in ordinary viewers, with no plugin: Foxglove's well-known messages, made of the wire
// messages.
//
// Everything is in the frame "world": metres, right-handed, +Z up (REP 103), whatever the client's convention: x, y,
// z here are z, x, y of the canonical frame, the world origin not taken away. Frames below it: "camera" (+X forward,
// +Z up), "camera_optical" (+Z forward, +Y down; what CameraCalibration asks for), "instance/<id>".
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <string>

#include "foxglove/frames.pb.h"
#include "foxglove/scene.pb.h"
#include "server/record/record_topics.h"
#include "server/session/convention.h"
#include "sightline/v1/camera_control.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// A tick is shown once a reply covers it: until then it may be refused.
//
// Not thread-safe. Holds one pose and at most one shape an instance, and at most kMaxInstances of them; more are not
// shown. Of the ticks that wait, as many as a SessionSnapshot.
class ViewerChannels {
 public:
  static constexpr size_t kMaxInstances = 4096;
  // Called with every message made, in the order of writing.
  using Emit = std::function<void(RecordTopic, const google::protobuf::MessageLite&)>;

  // A session that opens: the convention, and what the client named. A convention that cannot be read counts as glTF's.
  void take_open(const v1::OpenSession& open, uint64_t time_ns, const Emit& emit);
  // Makes nothing yet.
  void take_tick(const v1::Tick& tick, uint64_t time_ns, const Emit& emit);
  void take_reply(const v1::CameraReply& reply, uint64_t time_ns, const Emit& emit);
  void take_rejection(const v1::Rejection& rejection, uint64_t time_ns, const Emit& emit);
  void take_fault(const v1::Fault& fault, uint64_t time_ns, const Emit& emit);
  void take_gap(const v1::Gap& gap, uint64_t time_ns, const Emit& emit);
  // Shapes and still frames again: for the head of a next part.
  void emit_still(uint64_t time_ns, const Emit& emit) const;

 private:
  struct Instance {
    Pose world_from_instance;  // viewer's world
    bool moves = false;
    foxglove::SceneEntity shape;  // empty: a mesh, which is not drawn
    bool has_shape = false;
  };

  void add_instance(const v1::NewInstance& wire);
  void move_instances(const v1::Transforms& wire);
  void take_delta(const v1::SceneDelta& delta);
  void show_oldest();
  void take_lens(const v1::Lens& wire);
  void emit_frames(const Pose& camera, uint64_t time_ns, const Emit& emit) const;
  void emit_sight(const v1::CameraReply& reply, const Pose& camera, uint64_t time_ns, const Emit& emit) const;
  void emit_calibration(const v1::CameraReply& reply, uint64_t time_ns, const Emit& emit) const;
  void emit_log(int level, const std::string& name, const std::string& text, uint64_t time_ns,
                const Emit& emit) const;

  Convention client_;
  double aspect_ = 16.0 / 9.0;
  std::map<uint64_t, Instance> instances_;  // by the client's id
  std::deque<v1::Tick> waiting_;            // for a reply
  size_t waiting_bytes_ = 0;
  bool still_due_ = false;  // what is still has changed
  v1::Status last_status_ = v1::STATUS_UNSPECIFIED;
  v1::Reason last_reason_ = v1::REASON_UNSPECIFIED;
};

}  // namespace sightline
