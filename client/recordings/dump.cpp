// `sightline dump`: messages of MCAP files as JSON. The schemas come from the file itself, so that messages for viewers
// and files of other programs can be printed too.
#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/dynamic_message.h>
#include <google/protobuf/stubs/logging.h>
#include <google/protobuf/type.pb.h>
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/util/type_resolver_util.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "client/base/text_table.h"
#include "client/recordings/commands.h"
#include "client/recordings/recording.h"
#include "client/recordings/summary.h"

namespace sightline {
namespace {

namespace pb = google::protobuf;

constexpr char kTypeHost[] = "type.googleapis.com";

// Collects what is wrong with a schema, which protobuf would log otherwise.
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

// The printer asks for all types of a message at every message, and the pool's own resolver builds each of them every
// time.
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

// Single-threaded. Holds a pool of types for each schema that it has met. Schemas must outlive it and keep their
// addresses.
class MessageJson {
 public:
  // One line: protobuf's own JSON with the names of the .proto file; a message in JSON stays as it is. Fails with
  // kUnsupported for other encodings and for invalid schemas, and with kDataLoss for bytes that do not fit the schema.
  // The text is valid until the next call.
  Result<const std::string*> text_of(const McapMessage& message);

 private:
  struct Types {
    pb::DescriptorPool pool;
    pb::DynamicMessageFactory factory{&pool};
    const pb::Message* prototype = nullptr;
    bool requires_fields = false;  // of some message: it is not of proto3
    KeptTypes kept{pool};
    std::string url;
  };
  Result<Types*> types_of(const mcap::Schema& schema);

  std::map<const mcap::Schema*, Result<std::unique_ptr<Types>>> types_;
  std::string text_;
};

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
    if (type == nullptr) return tl::unexpected(unsupported(schema, "the schema has no message of its own name"));
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
  // The printer accepts any bytes, so the message itself is parsed first.
  const std::unique_ptr<pb::Message> read((*types)->prototype->New());
  // A proto3 message has no required fields, and the check costs about half as much as the parsing.
  if (!read->ParsePartialFromArray(m.message.data.data(), static_cast<int>(m.message.data.size())) ||
      ((*types)->requires_fields && !read->IsInitialized()))
    return fail(ErrorCode::kDataLoss, m.channel.topic, "is not what its schema says");
  pb::util::JsonPrintOptions print;
  print.preserve_proto_field_names = true;
  const auto done = pb::util::BinaryToJsonString(&(*types)->kept, (*types)->url, std::string(m.message.data), &text_,
                                                 print);
  if (!done.ok()) return fail(ErrorCode::kDataLoss, m.channel.topic, std::string(done.message()));
  return &text_;
}

// Any text as a JSON string. Bytes that are not UTF-8 are replaced.
std::string quoted(const std::string& text) {
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

// A topic that the file lacks is more likely a typing error than a wish for no output.
Status check_topics(const McapInfo& info, const std::vector<std::string>& topics) {
  for (const std::string& topic : topics) {
    const auto is_it = [&](const auto& channel) { return channel.second.topic == topic; };
    if (std::any_of(info.channels.begin(), info.channels.end(), is_it)) continue;
    std::string known;
    for (const auto& [_, channel] : info.channels) known.append(known.empty() ? "" : ", ").append(channel.topic);
    return fail(ErrorCode::kNotFound, "--topic",
                "the file has no topic " + printable(topic, 100) + "; it has " + printable(known, 1000));
  }
  return {};
}

struct Dumped {
  uint64_t lines = 0, undecodable = 0;
  std::string first_error;
  McapLoss loss;
  int write_errno = 0;  // why the output ended early; 0: it did not
};

class Dumper {
 public:
  Dumper(std::ostream& out, uint64_t limit) : out_(out), limit_(limit) {}

  // Returns false when no more messages are wanted.
  bool take(const McapMessage& m) {
    if (done_.lines >= limit_) return false;
    const auto text = json_.text_of(m);
    if (!text) {
      ++done_.undecodable;
      if (done_.first_error.empty()) done_.first_error = to_string(text.error());
    }
    errno = 0;
    out_ << "{\"topic\":" << quoted(m.channel.topic) << ",\"sequence\":" << m.message.sequence
         << ",\"log_time_ns\":" << m.message.log_time_ns << ",\"publish_time_ns\":" << m.message.publish_time_ns;
    if (text)
      out_ << ",\"message\":" << **text << "}\n";
    else
      out_ << ",\"error\":" << quoted(to_string(text.error())) << "}\n";
    ++done_.lines;
    if (!out_.good()) done_.write_errno = errno != 0 ? errno : EPIPE;
    return out_.good() && done_.lines < limit_;
  }
  Dumped take_done() { return std::move(done_); }

 private:
  std::ostream& out_;
  const uint64_t limit_;
  MessageJson json_;
  Dumped done_;
};

Result<Dumped> dump(const DumpOptions& options, std::ostream& out, ProgressBar& bar) {
  const auto source = open_watched(options.file, bar, "dumping");
  if (!source) return tl::unexpected(source.error());
  const auto reader = McapReader::open(**source, options.read.limits());
  if (!reader) return tl::unexpected(reader.error());
  if (Status ok = check_topics(reader->info(), options.topics); !ok) return tl::unexpected(ok.error());
  const uint64_t start_ns = reader->info().statistics.start_time_ns;
  const McapQuery query{.start_ns = log_time_after(start_ns, options.start_s),
                        .end_ns = log_time_after(start_ns, options.end_s),
                        .topics = options.topics};
  Dumper dumper(out, options.limit);
  const McapReadReport report = reader->read(query, [&](const McapMessage& m) { return dumper.take(m); });
  Dumped done = dumper.take_done();
  done.loss = report.loss;
  if (reader->info().loss.troubles > 0) done.loss = reader->info().loss;
  return done;
}

int tell(const std::string& file, const Result<Dumped>& done, std::ostream& err) {
  if (!done) {
    err << error_text(file, done.error()) << '\n';
    return 1;
  }
  // A missing end of the file is no error of the messages that are there.
  const bool lost = done->loss.chunks + done->loss.messages > 0;
  if (lost) err << file << ": lost " << loss_text(done->loss) << '\n';
  if (lost) print_troubles(err, done->loss);
  if (done->undecodable > 0)
    err << file << ": " << grouped(done->undecodable)
        << " messages cannot be decoded, the first: " << printable(done->first_error, 300) << '\n';
  return lost || done->undecodable > 0 ? 1 : 0;
}

// Writes the rest. Returns why `out` cannot be written, by its errno; 0: it can.
int end_of(std::ostream& out, const Result<Dumped>& done) {
  if (done && done->write_errno != 0) return done->write_errno;
  errno = 0;
  out.flush();
  if (out.good()) return 0;
  return errno != 0 ? errno : EPIPE;
}

}  // namespace

int run_dump_command(const DumpOptions& options, std::ostream& out, std::ostream& err) {
  if (options.out.empty()) {
    ProgressBar none(err, false);
    const auto done = dump(options, out, none);
    const int trouble = end_of(out, done);
    if (trouble == EPIPE) return 0;  // the reader has enough
    if (trouble != 0) {
      err << "the standard output cannot be written: " << std::strerror(trouble) << '\n';
      return 1;
    }
    return tell(options.file, done, err);
  }
  if (std::filesystem::exists(options.out)) {
    err << options.out << ": exists already\n";
    return 1;
  }
  std::ofstream file(options.out, std::ios::binary);
  if (!file.is_open()) {
    err << options.out << ": cannot be made: " << std::strerror(errno) << '\n';
    return 1;
  }
  ProgressBar bar(err, options.progress);
  const auto done = dump(options, file, bar);
  bar.clear();
  if (const int trouble = end_of(file, done); trouble != 0) {
    err << options.out << ": cannot be written: " << std::strerror(trouble) << '\n';
    file.close();
    std::error_code ignored;
    std::filesystem::remove(options.out, ignored);
    return 1;
  }
  return tell(options.file, done, err);
}

}  // namespace sightline
