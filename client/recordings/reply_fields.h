// Fields of replies that a recording does not know, because its server was older than this program. A recording brings
// the schema of its messages along, so the fields are known without a table of versions.
#pragma once

#include <google/protobuf/message.h>

#include <vector>

#include "server/record/mcap_reader.h"

namespace sightline {

// Fields of v1.CameraReply and of the messages in it that this program knows and the file's schema lacks. Empty when
// the file has no schema for replies, or one that cannot be read: then nothing is known to be missing. The result lives
// as long as the program.
std::vector<const google::protobuf::FieldDescriptor*> reply_fields_unknown_to(const McapInfo& file);

// Clears these fields in the message and in all messages in it.
void clear_fields(google::protobuf::Message& message,
                  const std::vector<const google::protobuf::FieldDescriptor*>& fields);

}  // namespace sightline
