// What is recorded on which topic, and the schemas that describe it.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace google::protobuf {
class Descriptor;
}

namespace sightline {

// The value is the place in all_record_topics().
enum class RecordTopic : uint16_t {
  kInfo,        // RecordingInfo; first in every file
  kOpen,        // OpenSession
  kOpened,      // SessionOpened
  kTick,        // Tick
  kReply,       // CameraReply
  kRejection,   // Rejection
  kFault,       // Fault
  kGap,         // Gap
  kVisibility,  // VisibilitySample, made of replies
  // Made for viewers, of ticks and replies; see viewer_channels.h.
  kFrames,        // foxglove.FrameTransforms: everything that has moved
  kStaticFrames,  // foxglove.FrameTransforms: what has not
  kShapes,        // foxglove.SceneUpdate: the shapes that the client named
  kSight,         // foxglove.SceneUpdate: the camera's frustum, and a line to every target
  kCameraPose,    // foxglove.PoseInFrame
  kCalibration,   // foxglove.CameraCalibration
  kLog,           // foxglove.Log: changes of status and reason, rejections, faults, gaps
  kCount
};
inline constexpr size_t kRecordTopics = static_cast<size_t>(RecordTopic::kCount);

struct RecordTopicInfo {
  const char* topic = nullptr;  // "/sightline/tick"
  const google::protobuf::Descriptor* message = nullptr;
};

const std::array<RecordTopicInfo, kRecordTopics>& all_record_topics();
// None: not one of ours.
std::optional<RecordTopic> record_topic_of(std::string_view name);

// A serialised google.protobuf.FileDescriptorSet of the message's file and all that it imports, imports first: what
// MCAP asks of a schema with the encoding "protobuf".
std::string descriptor_set_of(const google::protobuf::Descriptor& message);

}  // namespace sightline
