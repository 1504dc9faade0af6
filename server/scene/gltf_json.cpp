#include "server/scene/gltf_json.h"

namespace sightline {
namespace {

using nlohmann::json;

// Counts values while they are parsed. The parser offers no other way to stop than to throw.
class ParseGuard {
 public:
  explicit ParseGuard(const GltfLimits& limits) : limits_(limits) {}

  // `depth` counts the containers around the value.
  bool operator()(int depth, json::parse_event_t event, const json&) {
    using Event = json::parse_event_t;
    const bool opens = event == Event::object_start || event == Event::array_start;
    if (opens && depth >= limits_.max_json_depth)
      throw Error{ErrorCode::kResourceExhausted, "json",
                  "is nested deeper than " + std::to_string(limits_.max_json_depth)};
    if ((opens || event == Event::value) && ++values_ > limits_.max_json_values)
      throw Error{ErrorCode::kResourceExhausted, "json",
                  "has more than " + std::to_string(limits_.max_json_values) + " values"};
    return true;
  }

 private:
  const GltfLimits& limits_;
  size_t values_ = 0;
};

}  // namespace

Result<json> parse_gltf_json(std::string_view text, const GltfLimits& limits) {
  if (text.size() > limits.max_json_bytes)
    return fail(ErrorCode::kResourceExhausted, "json",
                "is longer than " + std::to_string(limits.max_json_bytes) + " bytes");
  try {
    json document = json::parse(text.begin(), text.end(), ParseGuard(limits));
    if (!document.is_object()) return fail(ErrorCode::kDataLoss, "json", "must be an object");
    return document;
  } catch (const Error& excess) {
    return tl::unexpected(excess);
  } catch (const json::parse_error& error) {
    return fail(ErrorCode::kDataLoss, "json", "is not valid JSON at byte " + std::to_string(error.byte));
  }
}

}  // namespace sightline
