#include "server/record/record_topics.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>

#include <set>

#include "foxglove/camera.pb.h"
#include "foxglove/frames.pb.h"
#include "foxglove/scene.pb.h"
#include "sightline/v1/camera_control.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {
namespace {

using google::protobuf::FileDescriptor;

void add_file(const FileDescriptor& file, std::set<const FileDescriptor*>& done,
              google::protobuf::FileDescriptorSet& out) {
  if (!done.insert(&file).second) return;
  for (int i = 0; i < file.dependency_count(); ++i) add_file(*file.dependency(i), done, out);
  file.CopyTo(out.add_file());
}

}  // namespace

const std::array<RecordTopicInfo, kRecordTopics>& all_record_topics() {
  static const std::array<RecordTopicInfo, kRecordTopics> topics{{
      {"/sightline/info", v1::RecordingInfo::descriptor()},
      {"/sightline/open", v1::OpenSession::descriptor()},
      {"/sightline/opened", v1::SessionOpened::descriptor()},
      {"/sightline/tick", v1::Tick::descriptor()},
      {"/sightline/reply", v1::CameraReply::descriptor()},
      {"/sightline/rejection", v1::TickError::descriptor()},
      {"/sightline/fault", v1::Fault::descriptor()},
      {"/sightline/gap", v1::Gap::descriptor()},
      {"/sightline/visibility", v1::VisibilitySample::descriptor()},
      {"/tf", foxglove::FrameTransforms::descriptor()},
      {"/tf_static", foxglove::FrameTransforms::descriptor()},
      {"/scene/shapes", foxglove::SceneUpdate::descriptor()},
      {"/scene/sight", foxglove::SceneUpdate::descriptor()},
      {"/camera/pose", foxglove::PoseInFrame::descriptor()},
      {"/camera/calibration", foxglove::CameraCalibration::descriptor()},
      {"/log", foxglove::Log::descriptor()},
  }};
  return topics;
}

std::optional<RecordTopic> record_topic_of(std::string_view name) {
  const auto& topics = all_record_topics();
  for (size_t i = 0; i < topics.size(); ++i)
    if (name == topics[i].topic) return static_cast<RecordTopic>(i);
  return std::nullopt;
}

std::string descriptor_set_of(const google::protobuf::Descriptor& message) {
  google::protobuf::FileDescriptorSet set;
  std::set<const FileDescriptor*> done;
  add_file(*message.file(), done, set);
  return set.SerializeAsString();
}

}  // namespace sightline
