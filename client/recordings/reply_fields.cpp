#include "client/recordings/reply_fields.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>

#include <map>
#include <set>
#include <string>

#include "sightline/v1/session.pb.h"

namespace sightline {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::DescriptorProto;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

using Fields = std::vector<const FieldDescriptor*>;
using Numbers = std::map<std::string, std::set<int>>;  // of the fields, by the full name of the message

void add(const DescriptorProto& message, const std::string& scope, Numbers& out) {
  const std::string name = scope.empty() ? message.name() : scope + '.' + message.name();
  std::set<int>& numbers = out[name];
  for (const auto& field : message.field()) numbers.insert(field.number());
  for (const DescriptorProto& nested : message.nested_type()) add(nested, name, out);
}

const mcap::Schema* schema_of(const McapInfo& file, const std::string& name) {
  for (const auto& [id, schema] : file.schemas)
    if (schema.name == name && schema.encoding == "protobuf") return &schema;
  return nullptr;
}

Numbers numbers_in(const mcap::Schema& schema) {
  google::protobuf::FileDescriptorSet files;
  Numbers numbers;
  if (!files.ParseFromString(schema.data)) return numbers;
  for (const auto& file : files.file())
    for (const DescriptorProto& message : file.message_type()) add(message, file.package(), numbers);
  return numbers;
}

// A message that the file does not know at all is in a field that it does not know.
void find_unknown(const Descriptor& message, const Numbers& known, std::set<const Descriptor*>& seen, Fields& out) {
  const auto numbers = known.find(message.full_name());
  if (numbers == known.end() || !seen.insert(&message).second) return;
  for (int i = 0; i < message.field_count(); ++i) {
    const FieldDescriptor& field = *message.field(i);
    if (!numbers->second.contains(field.number()))
      out.push_back(&field);
    else if (field.message_type())
      find_unknown(*field.message_type(), known, seen, out);
  }
}

}  // namespace

Fields reply_fields_unknown_to(const McapInfo& file) {
  const Descriptor& reply = *v1::CameraReply::descriptor();
  Fields unknown;
  std::set<const Descriptor*> seen;
  if (const mcap::Schema* schema = schema_of(file, reply.full_name()))
    find_unknown(reply, numbers_in(*schema), seen, unknown);
  return unknown;
}

void clear_fields(Message& message, const Fields& fields) {
  if (fields.empty()) return;
  const auto& reflection = *message.GetReflection();
  for (const FieldDescriptor* field : fields)
    if (field->containing_type() == message.GetDescriptor()) reflection.ClearField(&message, field);
  Fields present;
  reflection.ListFields(message, &present);
  for (const FieldDescriptor* field : present) {
    if (!field->message_type()) continue;
    if (!field->is_repeated()) {
      clear_fields(*reflection.MutableMessage(&message, field), fields);
      continue;
    }
    for (int i = 0; i < reflection.FieldSize(message, field); ++i)
      clear_fields(*reflection.MutableRepeatedMessage(&message, field, i), fields);
  }
}

}  // namespace sightline
