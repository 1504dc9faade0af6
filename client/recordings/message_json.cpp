#include "client/recordings/message_json.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/dynamic_message.h>
#include <google/protobuf/stubs/logging.h>
#include <google/protobuf/type.pb.h>
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/util/type_resolver_util.h>

#include <nlohmann/json.hpp>

namespace sightline {
namespace {

namespace pb = google::protobuf;

constexpr char kTypeHost[] = "type.googleapis.com";

// What is wrong with a schema, instead of the log.
class Complaint final : public pb::DescriptorPool::ErrorCollector {
 public:
  void AddError(const std::string&, const std::string& element, const pb::Message*, ErrorLocation,
                const std::string& message) override {
    if (text.empty()) text = element + ": " + message;
  }
  std::string text;
};

Error unsupported(const mcap::Schema& schema, std::string why) {
  return {ErrorCode::kUnsupported, schema.name, std::move(why)};
}

// The printer asks for all types of a message at every message, and the pool's own resolver makes each anew.
class KeptTypes final : public pb::util::TypeResolver {
 public:
  explicit KeptTypes(const pb::DescriptorPool& pool)
      : pool_(pb::util::NewTypeResolverForDescriptorPool(kTypeHost, &pool)) {}

  pb::util::Status ResolveMessageType(const std::string& url, pb::Type* type) override {
    return kept(messages_, url, type, &TypeResolver::ResolveMessageType);
  }
  pb::util::Status ResolveEnumType(const std::string& url, pb::Enum* type) override {
    return kept(enums_, url, type, &TypeResolver::ResolveEnumType);
  }

 private:
  template <typename Type>
  pb::util::Status kept(std::map<std::string, Type>& known, const std::string& url, Type* type,
                        pb::util::Status (TypeResolver::*make)(const std::string&, Type*)) {
    auto found = known.find(url);
    if (found == known.end()) {
      Type made;
      if (const pb::util::Status done = ((*pool_).*make)(url, &made); !done.ok()) return done;
      found = known.emplace(url, std::move(made)).first;
    }
    *type = found->second;
    return {};
  }

  const std::unique_ptr<TypeResolver> pool_;
  std::map<std::string, pb::Type> messages_;
  std::map<std::string, pb::Enum> enums_;
};

}  // namespace

struct MessageJson::Types {
  pb::DescriptorPool pool;
  pb::DynamicMessageFactory factory{&pool};
  const pb::Message* prototype = nullptr;
  bool requires_fields = false;  // some message may
  KeptTypes kept{pool};
  std::string url;
};

MessageJson::MessageJson() = default;
MessageJson::~MessageJson() = default;

Result<MessageJson::Types*> MessageJson::types_of(const mcap::Schema& schema) {
  if (const auto known = types_.find(&schema); known != types_.end()) {
    if (!known->second) return tl::unexpected(known->second.error());
    return known->second->get();
  }
  const auto make = [&]() -> Result<std::unique_ptr<Types>> {
    if (schema.encoding != "protobuf")
      return tl::unexpected(unsupported(schema, "the schema is no protobuf but \"" + schema.encoding + '"'));
    pb::FileDescriptorSet files;
    if (!files.ParseFromString(schema.data))
      return tl::unexpected(unsupported(schema, "the schema is no FileDescriptorSet"));
    auto types = std::make_unique<Types>();
    for (const pb::FileDescriptorProto& file : files.file()) {
      Complaint complaint;
      types->requires_fields |= file.syntax() != "proto3";
      if (types->pool.FindFileByName(file.name()) != nullptr) continue;
      if (types->pool.BuildFileCollectingErrors(file, &complaint) == nullptr)
        return tl::unexpected(unsupported(schema, "the schema does not go together: " + complaint.text));
    }
    const pb::Descriptor* type = types->pool.FindMessageTypeByName(schema.name);
    if (type == nullptr)
      return tl::unexpected(unsupported(schema, "the schema has no message of its own name"));
    types->prototype = types->factory.GetPrototype(type);
    types->url.append(kTypeHost).append("/").append(schema.name);
    return types;
  };
  const pb::LogSilencer quiet;
  const auto& made = types_.emplace(&schema, make()).first->second;
  if (!made) return tl::unexpected(made.error());
  return made->get();
}

Result<const std::string*> MessageJson::text_of(const McapMessage& m) {
  text_.clear();
  if (m.channel.message_encoding == "json") {
    const auto parsed = nlohmann::ordered_json::parse(m.message.data, nullptr, false);
    if (parsed.is_discarded()) return fail(ErrorCode::kDataLoss, m.channel.topic, "is no JSON");
    text_ = parsed.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    return &text_;
  }
  if (m.channel.message_encoding != "protobuf" || m.schema == nullptr)
    return fail(ErrorCode::kUnsupported, m.channel.topic,
                "is encoded as \"" + m.channel.message_encoding + "\", which is not known here");
  const auto types = types_of(*m.schema);
  if (!types) return tl::unexpected(types.error());
  const pb::LogSilencer quiet;
  // The printer takes whatever bytes it gets: whether they are such a message is asked of the message.
  const std::unique_ptr<pb::Message> read((*types)->prototype->New());
  // Of proto3 nothing can be missing, and looking for it costs as much as a good part of the reading.
  if (!read->ParsePartialFromArray(m.message.data.data(), static_cast<int>(m.message.data.size())) ||
      ((*types)->requires_fields && !read->IsInitialized()))
    return fail(ErrorCode::kDataLoss, m.channel.topic, "is not what its schema says");
  pb::util::JsonPrintOptions print;
  print.preserve_proto_field_names = true;
  const auto done = pb::util::BinaryToJsonString(&(*types)->kept, (*types)->url, std::string(m.message.data),
                                                 &text_, print);
  if (!done.ok()) return fail(ErrorCode::kDataLoss, m.channel.topic, std::string(done.message()));
  return &text_;
}

}  // namespace sightline
