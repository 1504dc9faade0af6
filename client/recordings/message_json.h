// Messages of MCAP files as JSON, by the schemas that stand in the file: those of ours, of viewers, and of any other file.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "server/base/error.h"
#include "server/record/mcap_reader.h"

namespace sightline {

// Single-threaded. Holds a pool of types for each schema that it has met; schemas must outlive it and keep their places.
class MessageJson {
 public:
  MessageJson();
  ~MessageJson();
  MessageJson(const MessageJson&) = delete;
  MessageJson& operator=(const MessageJson&) = delete;

  // One line: protobuf's own JSON with the names of the .proto file; messages in JSON as they are. Fails with
  // kUnsupported for other encodings and for schemas that are none, and with kDataLoss for bytes that are not what the
  // schema says. The text is valid until the next call.
  Result<const std::string*> text_of(const McapMessage& message);

 private:
  struct Types;
  Result<Types*> types_of(const mcap::Schema& schema);

  std::map<const mcap::Schema*, Result<std::unique_ptr<Types>>> types_;
  std::string text_;
};

}  // namespace sightline
