#include "client/replay/compare_messages.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/text_format.h>
#include <google/protobuf/util/field_comparator.h>
#include <google/protobuf/util/message_differencer.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

namespace sightline {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::util::MessageDifferencer;
using Path = std::vector<MessageDifferencer::SpecificField>;

// `index` is -1 for a field that is no list.
double number_of(const Message& message, const FieldDescriptor& field, int index) {
  const auto& r = *message.GetReflection();
  const bool list = index >= 0;
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return list ? r.GetRepeatedDouble(message, &field, index) : r.GetDouble(message, &field);
    case FieldDescriptor::CPPTYPE_FLOAT:
      return list ? r.GetRepeatedFloat(message, &field, index) : r.GetFloat(message, &field);
    case FieldDescriptor::CPPTYPE_UINT32:
      return list ? r.GetRepeatedUInt32(message, &field, index) : r.GetUInt32(message, &field);
    case FieldDescriptor::CPPTYPE_UINT64:
      return static_cast<double>(list ? r.GetRepeatedUInt64(message, &field, index) : r.GetUInt64(message, &field));
    case FieldDescriptor::CPPTYPE_INT64:
      return static_cast<double>(list ? r.GetRepeatedInt64(message, &field, index) : r.GetInt64(message, &field));
    case FieldDescriptor::CPPTYPE_INT32:
      return list ? r.GetRepeatedInt32(message, &field, index) : r.GetInt32(message, &field);
    default:
      return NAN;
  }
}

// Ids and hashes stand in fixed64 fields; they have no distance.
bool is_measure(const FieldDescriptor& field) {
  return field.type() != FieldDescriptor::TYPE_FIXED64 && field.cpp_type() <= FieldDescriptor::CPPTYPE_FLOAT;
}

// Compares floating-point numbers by their bits, and everything else as the differencer does by default.
class BitComparator final : public google::protobuf::util::FieldComparator {
 public:
  ComparisonResult Compare(const Message& a, const Message& b, const FieldDescriptor* field, int index_a, int index_b,
                           const google::protobuf::util::FieldContext* context) override {
    if (field->cpp_type() != FieldDescriptor::CPPTYPE_DOUBLE && field->cpp_type() != FieldDescriptor::CPPTYPE_FLOAT)
      return others_.Compare(a, b, field, index_a, index_b, context);
    // A float keeps its bits apart as a double.
    const auto bits = [&](const Message& message, int index) {
      return std::bit_cast<uint64_t>(number_of(message, *field, field->is_repeated() ? index : -1));
    };
    return bits(a, index_a) == bits(b, index_b) ? SAME : DIFFERENT;
  }

 private:
  google::protobuf::util::DefaultFieldComparator others_;
};

class Reporter final : public MessageDifferencer::Reporter {
 public:
  explicit Reporter(const std::function<void(const FieldDifference&)>& visit) : visit_(visit) {
    printer_.SetSingleLineMode(true);
  }
  void ReportAdded(const Message& a, const Message& b, const Path& path) override {
    report(&a, &b, path, may_be_absent(path.back()), false);
  }
  void ReportDeleted(const Message& a, const Message& b, const Path& path) override {
    report(&a, &b, path, false, may_be_absent(path.back()));
  }
  // The differencer also reports every message on the way to a field.
  void ReportModified(const Message& a, const Message& b, const Path& path) override {
    const FieldDescriptor* field = path.back().field;
    if (!field || field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) report(&a, &b, path, false, false);
  }

 private:
  // A path that ends at a field of another version of the contract has a number there instead of a descriptor.
  static bool may_be_absent(const MessageDifferencer::SpecificField& step) {
    return !step.field || step.field->is_repeated() || step.field->has_presence();
  }

  void report(const Message* a, const Message* b, const Path& path, bool absent_a, bool absent_b) {
    const auto& last = path.back();
    FieldDifference difference{path_text(path, true), path_text(path, false), {}, {}, {}};
    if (!last.field) {
      difference.a = absent_a ? "absent" : "unknown";
      difference.b = absent_b ? "absent" : "unknown";
      return visit_(difference);
    }
    const FieldDescriptor& field = *last.field;
    difference.a = absent_a ? "absent" : text_of(*a, field, last.index);
    difference.b = absent_b ? "absent" : text_of(*b, field, last.new_index);
    if (!absent_a && !absent_b && is_measure(field))
      difference.deviation = std::abs(number_of(*a, field, last.index) - number_of(*b, field, last.new_index));
    visit_(difference);
  }

  static std::string path_text(const Path& path, bool with_indices) {
    std::string text;
    for (const auto& step : path) {
      text.append(text.empty() ? "" : ".");
      text.append(step.field ? step.field->name() : std::to_string(step.unknown_field_number));
      if (!step.field || !step.field->is_repeated()) continue;
      text.append("[").append(with_indices ? std::to_string(std::max(step.index, step.new_index)) : "");
      text.append("]");
    }
    return text;
  }

  std::string text_of(const Message& message, const FieldDescriptor& field, int index) const {
    constexpr size_t kLongest = 80;
    std::string text;
    printer_.PrintFieldValueToString(message, &field, field.is_repeated() ? index : -1, &text);
    if (text.ends_with(' ')) text.pop_back();  // of a message on one line
    if (text.size() > kLongest) text.replace(kLongest, text.npos, "...");
    return text;
  }

  const std::function<void(const FieldDifference&)>& visit_;
  google::protobuf::TextFormat::Printer printer_;
};

}  // namespace

IgnoredFields fields_named(std::initializer_list<const char*> full_names) {
  IgnoredFields fields;
  for (const char* name : full_names) {
    fields.push_back(google::protobuf::DescriptorPool::generated_pool()->FindFieldByName(name));
    assert(fields.back());
  }
  return fields;
}

void for_each_difference(const Message& a, const Message& b, const IgnoredFields& ignored,
                         const std::function<void(const FieldDifference&)>& visit) {
  BitComparator comparator;
  Reporter reporter(visit);
  MessageDifferencer differencer;
  differencer.set_field_comparator(&comparator);
  for (const FieldDescriptor* field : ignored) differencer.IgnoreField(field);
  differencer.ReportDifferencesTo(&reporter);
  differencer.Compare(a, b);
}

std::optional<FieldDifference> first_difference(const Message& a, const Message& b, const IgnoredFields& ignored) {
  std::optional<FieldDifference> first;
  for_each_difference(a, b, ignored, [&](const FieldDifference& difference) {
    if (!first) first = difference;
  });
  return first;
}

}  // namespace sightline
