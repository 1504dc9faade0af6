// The fields in which two messages of one type differ, found by protobuf's MessageDifferencer.
#pragma once

#include <google/protobuf/message.h>

#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

namespace sightline {

struct FieldDifference {
  std::string path;     // "targets[1].occluders[0].share"
  std::string general;  // the same without indices: "targets[].occluders[].share"
  // The values as text: numbers with all significant digits, enums by name, "absent" for a field that one message
  // lacks.
  std::string a, b;
  std::optional<double> deviation;  // |a - b| of a number; none: an id, a text or a message
};

// Fields that do not count, by full name, e.g. "sightline.v1.CameraReply.stage_times".
using IgnoredFields = std::vector<const google::protobuf::FieldDescriptor*>;
IgnoredFields fields_named(std::initializer_list<const char*> full_names);

// Calls `visit` for every field in which the messages differ, in the order of field numbers. Floating-point numbers are
// compared by their bits: 0 and -0 differ, and so do two kinds of NaN. Elements that only the longer of two lists has
// count one by one; a message that only one side has counts once. A field that this version of the contract does not
// know has its number in the path, and its value is "unknown". Both messages must be of one type.
void for_each_difference(const google::protobuf::Message& a, const google::protobuf::Message& b,
                         const IgnoredFields& ignored, const std::function<void(const FieldDifference&)>& visit);

std::optional<FieldDifference> first_difference(const google::protobuf::Message& a, const google::protobuf::Message& b,
                                                const IgnoredFields& ignored);

}  // namespace sightline
