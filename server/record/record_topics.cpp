#include "server/record/record_topics.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>

#include <algorithm>
#include <set>

#include "foxglove/camera.pb.h"
#include "foxglove/frames.pb.h"
#include "foxglove/scene.pb.h"
#include "sightline/options/v1/setting.pb.h"
#include "sightline/v1/camera_control.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {
namespace {

using google::protobuf::DescriptorProto;
using google::protobuf::FileDescriptor;

// Settings are annotated in their .proto files (unit, range, default). Readers of a recording need none of it, and it
// would stand in every file of a session several times.
const FileDescriptor& annotations() {
  return *options::v1::Setting::descriptor()->file();
}

void remove_annotations(DescriptorProto& message) {
  for (auto& field : *message.mutable_field()) {
    if (!field.has_options()) continue;
    field.mutable_options()->ClearExtension(options::v1::setting);
    if (field.options().ByteSizeLong() == 0) field.clear_options();
  }
  for (DescriptorProto& nested : *message.mutable_nested_type()) remove_annotations(nested);
}

void add_file(const FileDescriptor& file, std::set<const FileDescriptor*>& done,
              google::protobuf::FileDescriptorSet& out) {
  if (&file == &annotations() || !done.insert(&file).second) return;
  for (int i = 0; i < file.dependency_count(); ++i) add_file(*file.dependency(i), done, out);
  google::protobuf::FileDescriptorProto& copy = *out.add_file();
  file.CopyTo(&copy);
  auto& imports = *copy.mutable_dependency();
  imports.erase(std::remove(imports.begin(), imports.end(), annotations().name()), imports.end());
  for (DescriptorProto& message : *copy.mutable_message_type()) remove_annotations(message);
}

}  // namespace

const std::array<RecordTopicInfo, kRecordTopics>& all_record_topics() {
  static const std::array<RecordTopicInfo, kRecordTopics> topics{{
      {"/sightline/info", v1::RecordingInfo::descriptor()},
      {"/sightline/open", v1::OpenSession::descriptor()},
      {"/sightline/opened", v1::SessionOpened::descriptor()},
      {"/sightline/tick", v1::Tick::descriptor()},
      {"/sightline/reply", v1::CameraReply::descriptor()},
      {"/sightline/tick_error", v1::TickError::descriptor()},
      {"/sightline/fault", v1::Fault::descriptor()},
      {"/sightline/gap", v1::Gap::descriptor()},
      {"/sightline/memory", v1::StepMemory::descriptor()},
      {"/sightline/visibility", v1::VisibilitySample::descriptor()},
      {"/tf", foxglove::FrameTransforms::descriptor()},
      {"/tf_static", foxglove::FrameTransforms::descriptor()},
      {"/scene/shapes", foxglove::SceneUpdate::descriptor()},
      {"/scene/level", foxglove::SceneUpdate::descriptor()},
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
