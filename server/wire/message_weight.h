// How much memory a message would take, without parsing it.
#pragma once

#include <google/protobuf/descriptor.h>

#include <cstddef>
#include <span>

namespace sightline {

// Returns a rough upper estimate of the memory of a parsed message of this type, in bytes. Two bytes on the wire can
// become an empty message of more than a hundred bytes. The function allocates nothing, and stops counting at `enough`.
// Invalid bytes count as far as they can be read.
size_t message_weight(const google::protobuf::Descriptor& type, std::span<const std::byte> bytes, size_t enough);

}  // namespace sightline
