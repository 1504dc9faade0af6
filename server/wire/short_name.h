// Short names of the contract's enum values, for people.
#pragma once

#include <google/protobuf/generated_enum_reflection.h>

#include <cctype>
#include <string>

namespace sightline {

// The value's name without its enum's prefix: TRACKING_STATUS_PARTIAL_VIEW -> "PARTIAL_VIEW". Empty for a number that
// the enum does not define.
template <typename Enum>
std::string short_name(Enum value) {
  const google::protobuf::EnumDescriptor& type = *google::protobuf::GetEnumDescriptor<Enum>();
  const google::protobuf::EnumValueDescriptor* named = type.FindValueByNumber(static_cast<int>(value));
  if (!named) return "";
  std::string prefix;  // TrackingStatus -> TRACKING_STATUS_
  for (const char c : type.name()) {
    if (std::isupper(static_cast<unsigned char>(c)) && !prefix.empty()) prefix += '_';
    prefix += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  }
  prefix += '_';
  return named->name().starts_with(prefix) ? named->name().substr(prefix.size()) : named->name();
}

}  // namespace sightline
