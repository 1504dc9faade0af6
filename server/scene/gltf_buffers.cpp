#include "server/scene/gltf_buffers.h"

#include <cstring>
#include <map>

#include "server/scene/gltf_meshopt.h"

namespace sightline {
namespace {

// Placeholders of an exporter are few. Each costs the text of its error, and perhaps the search for a file.
constexpr size_t kMostAbsent = 1000;

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

// False on a '%' that two hexadecimal digits do not follow.
bool percent_decode(const std::string& uri, std::string& decoded) {
  for (size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] != '%') {
      decoded.push_back(uri[i]);
      continue;
    }
    if (uri.size() - i < 3 || hex_digit(uri[i + 1]) < 0 || hex_digit(uri[i + 2]) < 0) return false;
    decoded.push_back(static_cast<char>(hex_digit(uri[i + 1]) * 16 + hex_digit(uri[i + 2])));
    i += 2;
  }
  return true;
}

bool has_parent_segment(const std::string& path) {
  for (size_t start = 0; start <= path.size();) {
    const size_t end = std::min(path.find('/', start), path.size());
    if (path.compare(start, end - start, "..") == 0) return true;
    start = end + 1;
  }
  return false;
}

class BufferLoader {
 public:
  BufferLoader(const GltfContainer& container, const ExternalFile& external, const GltfLimits& limits,
               GltfDocument& document)
      : container_(container), external_(external), limits_(limits), document_(document) {}

  Status load(const nlohmann::json& buffer, size_t index) {
    const std::string field = gltf_path("buffers", index);
    if (!buffer.contains("uri") && !(index == 0 && container_.binary_chunk))
      return leave_out(
          index, {ErrorCode::kInvalidArgument, field + ".uri", "is missing, and there is no binary chunk for it"});
    const size_t length = buffer["byteLength"].get<size_t>();
    if (length > limits_.max_file_bytes - total_)
      return fail(ErrorCode::kResourceExhausted, field + ".byteLength",
                  "the buffers together are larger than " + std::to_string(limits_.max_file_bytes) + " bytes");
    total_ += length;
    const auto source = source_of(buffer, field);
    if (!source && is_missing(source.error())) return leave_out(index, source.error());
    if (!source) return tl::unexpected(source.error());
    if (source->size() < length)
      return fail(ErrorCode::kDataLoss, field,
                  "needs " + std::to_string(length) + " bytes, there are " + std::to_string(source->size()));
    document_.buffers.push_back(source->first(length));
    return {};
  }

 private:
  using Bytes = std::span<const std::byte>;

  // Limits, and the end of the work, are errors at once.
  static bool is_missing(const Error& error) {
    return error.code == ErrorCode::kInvalidArgument || error.code == ErrorCode::kNotFound ||
           error.code == ErrorCode::kDataLoss;
  }
  Status leave_out(size_t index, Error why) {
    if (document_.absent_buffers.size() == kMostAbsent)
      return fail(ErrorCode::kResourceExhausted, "buffers",
                  "more than " + std::to_string(kMostAbsent) +
                      " of them have no bytes, the first: " + document_.absent_buffers.begin()->second.message);
    document_.absent_buffers.emplace(index, std::move(why));
    document_.buffers.emplace_back();
    return {};
  }

  Result<Bytes> source_of(const nlohmann::json& buffer, const std::string& field) {
    if (!buffer.contains("uri")) return *container_.binary_chunk;
    const std::string uri = buffer["uri"].get<std::string>();
    return uri.starts_with("data:") ? from_data_uri(uri, field) : from_file(uri, field);
  }

  // RFC 2397: "data:", any media type, perhaps ";base64", a comma and the data. tinygltf takes a few media types only,
  // so it sees one of them.
  Result<Bytes> from_data_uri(const std::string& uri, const std::string& field) {
    const auto damaged = fail(ErrorCode::kDataLoss, field + ".uri", "is not a data URI that can be decoded");
    const size_t comma = uri.find(',');
    std::string data;
    if (comma == std::string::npos || !percent_decode(uri.substr(comma + 1), data)) return damaged;
    if (!std::string_view(uri).substr(0, comma).ends_with(";base64")) return own(std::as_bytes(std::span(data)));
    std::vector<unsigned char> decoded;
    std::string mime_type;
    data.insert(0, "data:application/octet-stream;base64,");
    if (!tinygltf::DecodeDataURI(&decoded, mime_type, data, 0, false)) return damaged;
    return own(std::as_bytes(std::span(decoded)));
  }

  Result<Bytes> from_file(const std::string& uri, const std::string& field) {
    const auto path = relative_path_of_uri(uri, field + ".uri");
    if (!path) return tl::unexpected(path.error());
    if (const auto known = files_.find(*path); known != files_.end()) return known->second;
    if (!external_) return invalid(field + ".uri", "refers to the file \"" + *path + "\", which is not allowed here");
    auto bytes = external_(*path);
    if (!bytes) {
      Error error = std::move(bytes.error());
      if (error.field.empty()) error.field = field + ".uri";
      return tl::unexpected(std::move(error));
    }
    document_.external_hashes.push_back(hash_bytes(*bytes));
    document_.owned.push_back(std::move(*bytes));
    return files_[*path] = document_.owned.back();
  }

  Bytes own(Bytes bytes) { return document_.owned.emplace_back(bytes.begin(), bytes.end()); }

  const GltfContainer& container_;
  const ExternalFile& external_;
  const GltfLimits& limits_;
  GltfDocument& document_;
  std::map<std::string, Bytes> files_;  // several buffers may name one file
  size_t total_ = 0;
};

}  // namespace

Result<std::string> relative_path_of_uri(const std::string& uri, const std::string& field) {
  std::string path;
  if (!percent_decode(uri, path)) return invalid(field, "has a broken percent escape");
  for (const char c : path)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F || c == '\\')
      return invalid(field, "has a control character or a backslash");
  if (path.empty() || path.front() == '/') return invalid(field, "must be a relative path");
  if (path.substr(0, path.find('/')).find(':') != std::string::npos)
    return invalid(field, "must be a relative path, not a URI with a scheme");
  if (has_parent_segment(path)) return invalid(field, "must not contain \"..\"");
  return path;
}

Status load_gltf_buffers(const GltfContainer& container, const ExternalFile& external, const GltfLimits& limits,
                         GltfDocument& document) {
  const nlohmann::json& json = document.json;
  if (!json.contains("buffers")) return {};
  BufferLoader loader(container, external, limits, document);
  const std::vector<bool> is_fallback = meshopt_fallback_buffers(json);
  for (size_t i = 0; i < json["buffers"].size(); ++i)
    if (document.work.ends(64))
      return tl::unexpected(document.work.limit()->error());
    else if (i < is_fallback.size() && is_fallback[i])
      document.buffers.emplace_back();
    else if (const Status status = loader.load(json["buffers"][i], i); !status)
      return status;
  return {};
}

}  // namespace sightline
