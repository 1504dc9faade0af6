// Two messages of one type, field by field, by reflection: where they differ, to the bit, and by how much.
#pragma once

#include <google/protobuf/message.h>

#include <functional>
#include <initializer_list>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

namespace sightline {

// From the message down: "targets[1].occluders[0].share".
struct FieldStep {
  const google::protobuf::FieldDescriptor* field = nullptr;
  int index = -1;  // of a repeated field; -1: none, or the number of its elements is meant
};
using FieldPath = std::vector<FieldStep>;

std::string to_string(const FieldPath& path);
// Without the places in lists: "targets[].occluders[].share".
std::string general_name(const FieldPath& path);

// A value of a message that the other has not, or has otherwise. Valid during the call that it is handed to.
struct FieldDifference {
  const FieldPath& path;
  // As a person reads them: numbers with all digits that tell them apart, enums by name; "absent"; of lists of different
  // lengths "3 elements".
  std::function<std::string()> a, b;
  std::optional<double> deviation;  // |a - b| of numbers; an absent message counts as one of zeros
};

// Full names of fields that do not count, e.g. "sightline.v1.CameraReply.stage_times".
using IgnoredFields = std::set<const google::protobuf::FieldDescriptor*>;
IgnoredFields fields_named(std::initializer_list<const char*> full_names);

// Hands over every field in which they differ, in the order of the schema, until `visit` answers false. Floating-point
// numbers are compared by their bits: 0 and -0 differ, and so do two kinds of NaN. Both must be of one type.
void for_each_difference(const google::protobuf::Message& a, const google::protobuf::Message& b,
                         const IgnoredFields& ignored,
                         const std::function<bool(const FieldDifference&)>& visit);

struct NamedDifference {
  std::string path, a, b;
};
std::optional<NamedDifference> first_difference(const google::protobuf::Message& a,
                                                const google::protobuf::Message& b,
                                                const IgnoredFields& ignored);

}  // namespace sightline
