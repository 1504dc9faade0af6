// The topics of a recording, their message types, and the schemas that describe them.
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

// The value is the index in all_record_topics().
enum class RecordTopic : uint16_t {
  kInfo,        // RecordingInfo; first in every file
  kOpen,        // OpenSession
  kOpened,      // SessionOpened
  kTick,        // Tick
  kReply,       // CameraReply
  kTickError,   // TickError
  kFault,       // Fault
  kGap,         // Gap
  kMemory,      // StepMemory
  kVisibility,  // VisibilitySample, made from replies
  // Made for viewers, from ticks and replies; see viewer_channels.h.
  kFrames,        // foxglove.FrameTransforms: instances that have moved
  kStaticFrames,  // foxglove.FrameTransforms: instances that have not
  kShapes,        // foxglove.SceneUpdate: the shapes that the client sent
  kLevel,         // foxglove.SceneUpdate: the triangles of the scene file
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
// Empty for the name of another topic.
std::optional<RecordTopic> record_topic_of(std::string_view name);

// A serialised google.protobuf.FileDescriptorSet of the message's file and all its imports, imports first, as MCAP asks
// of a schema with the encoding "protobuf". The annotations of settings are left out.
std::string descriptor_set_of(const google::protobuf::Descriptor& message);

}  // namespace sightline
