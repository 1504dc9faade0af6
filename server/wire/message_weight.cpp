#include "server/wire/message_weight.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>

#include <cstdint>

namespace sightline {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::internal::WireFormatLite;
using google::protobuf::io::CodedInputStream;

// Of an element of a repeated message field, with its pointer and the overhead of the allocation.
constexpr size_t kOfMessage = 144;
constexpr size_t kOfString = 64;
// One byte on the wire can become a number of eight.
constexpr size_t kOfPackedByte = 8;
// protobuf's own limit.
constexpr int kMostDepth = 100;

struct Weigher {
  CodedInputStream& in;
  const size_t enough;
  size_t weight = 0;

  // False when the bytes end or the weight is enough.
  bool message(const Descriptor* type, int depth) {
    if (depth > kMostDepth) return false;
    while (const uint32_t tag = in.ReadTag()) {
      const FieldDescriptor* const field = type ? type->FindFieldByNumber(WireFormatLite::GetTagFieldNumber(tag))
                                                : nullptr;
      if (WireFormatLite::GetTagWireType(tag) != WireFormatLite::WIRETYPE_LENGTH_DELIMITED) {
        if (!WireFormatLite::SkipField(&in, tag)) return false;
        weight += sizeof(uint64_t);
      } else if (!length_delimited(field, depth)) {
        return false;
      }
      if (weight >= enough) return false;
    }
    return true;
  }

  bool length_delimited(const FieldDescriptor* field, int depth) {
    uint32_t length = 0;
    if (!in.ReadVarint32(&length)) return false;
    if (field && field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      weight += kOfMessage;
      const auto limit = in.PushLimit(static_cast<int>(length));
      const bool whole = message(field->message_type(), depth + 1);
      in.PopLimit(limit);
      return whole;
    }
    weight += field && field->is_packable() ? kOfPackedByte * size_t{length} : kOfString + size_t{length};
    return in.Skip(static_cast<int>(length));
  }
};

}  // namespace

size_t message_weight(const Descriptor& type, std::span<const std::byte> bytes, size_t enough) {
  CodedInputStream in(reinterpret_cast<const uint8_t*>(bytes.data()), static_cast<int>(bytes.size()));
  Weigher weigher{in, enough};
  weigher.message(&type, 0);
  return weigher.weight;
}

}  // namespace sightline
