// Every setting that a client can send, found in the messages' descriptors, so that no test lists them.
#pragma once

#include <google/protobuf/message.h>

#include <functional>
#include <string>

#include "server/wire/from_proto_values.h"
#include "server/wire/settings_to_proto.h"
#include "sightline/options/v1/setting.pb.h"

namespace sightline::test {

// Settings and tuning as OpenSession sends them, every field set but the preset.
inline v1::OpenSession wire_of(const StepSettings& settings) {
  v1::OpenSession open;
  *open.mutable_settings() = settings_to_proto(settings);
  *open.mutable_tuning() = tuning_to_proto(settings);
  return open;
}

// For comparing sets of settings field by field.
inline std::string text_of(const StepSettings& settings) {
  return wire_of(settings).DebugString();
}

struct FoundSetting {
  std::string path;  // "tuning.move.cost.occlusion"
  google::protobuf::Message& message;
  const google::protobuf::FieldDescriptor& field;
  const options::v1::Setting& annotation;
};

inline void for_each_setting(google::protobuf::Message& message, const std::string& path,
                             const std::function<void(const FoundSetting&)>& visit) {
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const google::protobuf::FieldDescriptor& field = *message.GetDescriptor()->field(i);
    if (field.name() == "preset") continue;
    const std::string at = path + "." + field.name();
    if (field.message_type() != nullptr)
      for_each_setting(*message.GetReflection()->MutableMessage(&message, &field), at, visit);
    else
      visit({at, message, field, field.options().GetExtension(options::v1::setting)});
  }
}

// Visits the settings of both messages.
inline void for_each_setting(v1::OpenSession& open, const std::function<void(const FoundSetting&)>& visit) {
  for_each_setting(*open.mutable_settings(), "settings", visit);
  for_each_setting(*open.mutable_tuning(), "tuning", visit);
}

}  // namespace sightline::test
