#include "server/scene/gltf_json.h"

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

namespace sightline {
namespace {

using nlohmann::json;

// JSON has one kind of number: 12.0 and 1.2e1 are the index 12. Beyond 2^53 a double need not be the number that was
// written.
json whole_or_not(double value) {
  constexpr double kMostExact = 9007199254740992.0;
  if (value != std::floor(value) || std::abs(value) > kMostExact || std::signbit(value)) return value;
  return static_cast<uint64_t>(value);
}

// Builds the document while the text is parsed. The library's own way to look at each value meanwhile, a callback, goes
// through all siblings again at the end of every container, which takes time that grows with the square of the text's
// length.
class Builder final : public json::json_sax_t {
 public:
  explicit Builder(const GltfLimits& limits) : limits_(limits), work_(limits.work) {}

  bool null() override { return add(nullptr); }
  bool boolean(bool value) override { return add(value); }
  bool number_integer(number_integer_t value) override { return add(value); }
  bool number_unsigned(number_unsigned_t value) override { return add(value); }
  bool number_float(number_float_t value, const string_t&) override { return add(whole_or_not(value)); }
  bool string(string_t& value) override { return add(std::move(value)); }
  bool binary(binary_t&) override { return false; }  // JSON has none
  bool start_object(std::size_t) override { return open(json::object()); }
  bool start_array(std::size_t) override { return open(json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }
  bool key(string_t& name) override {
    member_ = &(*open_.back())[name];
    return true;
  }
  bool parse_error(std::size_t position, const std::string&, const json::exception&) override {
    error_ = Error{ErrorCode::kDataLoss, "json", "is not valid JSON at byte " + std::to_string(position)};
    return false;
  }

  json take() { return std::move(document_); }
  const std::optional<Error>& error() const { return error_; }

 private:
  bool exceeds(const std::string& message) {
    error_ = Error{ErrorCode::kResourceExhausted, "json", message};
    return false;
  }
  bool counts() {
    if (++values_ > limits_.max_json_values)
      return exceeds("has more than " + std::to_string(limits_.max_json_values) + " values");
    if (!work_.ends()) return true;
    error_ = limits_.work->error();
    return false;
  }
  // A member that is there already is replaced.
  json* place(json value) {
    if (open_.empty()) return &(document_ = std::move(value));
    if (!open_.back()->is_array()) return &(*member_ = std::move(value));
    open_.back()->push_back(std::move(value));
    return &open_.back()->back();
  }
  template <typename Value>
  bool add(Value&& value) {
    if (!counts()) return false;
    place(std::forward<Value>(value));
    return true;
  }
  bool open(json container) {
    if (open_.size() >= static_cast<size_t>(limits_.max_json_depth))
      return exceeds("is nested deeper than " + std::to_string(limits_.max_json_depth));
    if (!counts()) return false;
    open_.push_back(place(std::move(container)));
    return true;
  }
  bool close() {
    open_.pop_back();
    return true;
  }

  const GltfLimits& limits_;
  WorkLimit::Part work_;
  size_t values_ = 0;
  json document_;
  std::vector<json*> open_;  // the containers around the next value; none of them moves while it is open
  json* member_ = nullptr;   // of the innermost one, if it is an object: where the next value goes
  std::optional<Error> error_;
};

}  // namespace

Result<json> parse_gltf_json(std::string_view text, const GltfLimits& limits) {
  if (text.size() > limits.max_json_bytes)
    return fail(ErrorCode::kResourceExhausted, "json",
                "is longer than " + std::to_string(limits.max_json_bytes) + " bytes");
  Builder builder(limits);
  if (!json::sax_parse(text.begin(), text.end(), &builder)) return tl::unexpected(*builder.error());
  json document = builder.take();
  if (!document.is_object()) return fail(ErrorCode::kDataLoss, "json", "must be an object");
  return document;
}

}  // namespace sightline
