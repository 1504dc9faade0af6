#include "client/replay/compare_messages.h"

#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <charconv>
#include <cmath>

namespace sightline {
namespace {

using google::protobuf::EnumValueDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

// The shortest text that gives the same number again.
template <typename Number>
std::string shortest(Number value) {
  char text[64];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  return {text, end};
}

std::string quoted(const std::string& text) {
  constexpr size_t kLongest = 80;
  std::string quote = "\"";
  quote.append(text.substr(0, kLongest)).append(text.size() > kLongest ? "...\"" : "\"");
  return quote;
}

// One value of one message.
struct Value {
  const Message& message;
  const FieldDescriptor& field;
  int index;  // -1: not of a list

  const Reflection& reflection() const { return *message.GetReflection(); }

  // `single` and `listed` are the two getters of Reflection for one type.
  template <typename Got>
  Got get(Got (Reflection::*single)(const Message&, const FieldDescriptor*) const,
          Got (Reflection::*listed)(const Message&, const FieldDescriptor*, int) const) const {
    return index < 0 ? (reflection().*single)(message, &field)
                     : (reflection().*listed)(message, &field, index);
  }
  double real64() const { return get(&Reflection::GetDouble, &Reflection::GetRepeatedDouble); }
  float real32() const { return get(&Reflection::GetFloat, &Reflection::GetRepeatedFloat); }
  int64_t int64() const { return get(&Reflection::GetInt64, &Reflection::GetRepeatedInt64); }
  uint64_t uint64() const { return get(&Reflection::GetUInt64, &Reflection::GetRepeatedUInt64); }
  int32_t int32() const { return get(&Reflection::GetInt32, &Reflection::GetRepeatedInt32); }
  uint32_t uint32() const { return get(&Reflection::GetUInt32, &Reflection::GetRepeatedUInt32); }
  bool boolean() const { return get(&Reflection::GetBool, &Reflection::GetRepeatedBool); }
  int enumeration() const { return get(&Reflection::GetEnumValue, &Reflection::GetRepeatedEnumValue); }
  std::string text() const { return get(&Reflection::GetString, &Reflection::GetRepeatedString); }
};

bool same(const Value& a, const Value& b) {
  switch (a.field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return std::bit_cast<uint64_t>(a.real64()) == std::bit_cast<uint64_t>(b.real64());
    case FieldDescriptor::CPPTYPE_FLOAT:
      return std::bit_cast<uint32_t>(a.real32()) == std::bit_cast<uint32_t>(b.real32());
    case FieldDescriptor::CPPTYPE_INT64:
      return a.int64() == b.int64();
    case FieldDescriptor::CPPTYPE_UINT64:
      return a.uint64() == b.uint64();
    case FieldDescriptor::CPPTYPE_INT32:
      return a.int32() == b.int32();
    case FieldDescriptor::CPPTYPE_UINT32:
      return a.uint32() == b.uint32();
    case FieldDescriptor::CPPTYPE_BOOL:
      return a.boolean() == b.boolean();
    case FieldDescriptor::CPPTYPE_ENUM:
      return a.enumeration() == b.enumeration();
    case FieldDescriptor::CPPTYPE_STRING:
      return a.text() == b.text();
    case FieldDescriptor::CPPTYPE_MESSAGE:
      break;
  }
  assert(false);
  return true;
}

std::string text_of(const Value& value) {
  switch (value.field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return shortest(value.real64());
    case FieldDescriptor::CPPTYPE_FLOAT:
      return shortest(value.real32());
    case FieldDescriptor::CPPTYPE_INT64:
      return shortest(value.int64());
    case FieldDescriptor::CPPTYPE_UINT64:
      return shortest(value.uint64());
    case FieldDescriptor::CPPTYPE_INT32:
      return shortest(value.int32());
    case FieldDescriptor::CPPTYPE_UINT32:
      return shortest(value.uint32());
    case FieldDescriptor::CPPTYPE_BOOL:
      return value.boolean() ? "true" : "false";
    case FieldDescriptor::CPPTYPE_ENUM: {
      const EnumValueDescriptor* known = value.field.enum_type()->FindValueByNumber(value.enumeration());
      return known ? known->name() : shortest(value.enumeration());
    }
    case FieldDescriptor::CPPTYPE_STRING:
      return quoted(value.text());
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return value.message.ShortDebugString();
  }
  return {};
}

// Of what is measured or counted; ids and hashes stand in fixed64 fields and have no distance.
std::optional<double> number_of(const Value& value) {
  if (value.field.type() == FieldDescriptor::TYPE_FIXED64) return std::nullopt;
  switch (value.field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return value.real64();
    case FieldDescriptor::CPPTYPE_FLOAT:
      return value.real32();
    case FieldDescriptor::CPPTYPE_INT64:
      return static_cast<double>(value.int64());
    case FieldDescriptor::CPPTYPE_UINT64:
      return static_cast<double>(value.uint64());
    case FieldDescriptor::CPPTYPE_INT32:
      return value.int32();
    case FieldDescriptor::CPPTYPE_UINT32:
      return value.uint32();
    default:
      return std::nullopt;
  }
}

class Walk {
 public:
  Walk(const IgnoredFields& ignored, const std::function<bool(const FieldDifference&)>& visit)
      : ignored_(ignored), visit_(visit) {}

  // False: `visit` has had enough.
  bool messages(const Message& a, const Message& b) {
    const google::protobuf::Descriptor& type = *a.GetDescriptor();
    for (int i = 0; i < type.field_count(); ++i) {
      const FieldDescriptor& field = *type.field(i);
      if (ignored_.count(&field) > 0) continue;
      path_.push_back({&field, -1});
      const bool more = field.is_repeated() ? lists(a, b, field) : singles(a, b, field);
      path_.pop_back();
      if (!more) return false;
    }
    return true;
  }

 private:
  bool lists(const Message& a, const Message& b, const FieldDescriptor& field) {
    const int count_a = a.GetReflection()->FieldSize(a, &field),
              count_b = b.GetReflection()->FieldSize(b, &field);
    if (count_a != count_b) {
      const auto count_text = [](int count) {
        return [count] { return std::to_string(count).append(" elements"); };
      };
      if (!visit_({path_, count_text(count_a), count_text(count_b), std::nullopt})) return false;
    }
    bool more = true;
    for (int i = 0; more && i < std::min(count_a, count_b); ++i) {
      path_.back().index = i;
      more = values({a, field, i}, {b, field, i});
    }
    return more;
  }

  bool singles(const Message& a, const Message& b, const FieldDescriptor& field) {
    const bool has_a = !field.has_presence() || a.GetReflection()->HasField(a, &field);
    const bool has_b = !field.has_presence() || b.GetReflection()->HasField(b, &field);
    if (!has_a && !has_b) return true;
    if (has_a == has_b) return values({a, field, -1}, {b, field, -1});
    const Value value_a{a, field, -1}, value_b{b, field, -1};
    const bool is_message = field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
    const auto text = [is_message](bool has, const Value& value) {
      return [=] {
        return !has ? std::string("absent") : is_message ? std::string("present") : text_of(value);
      };
    };
    if (!visit_({path_, text(has_a, value_a), text(has_b, value_b), std::nullopt})) return false;
    return !is_message || values(value_a, value_b);
  }

  bool values(const Value& a, const Value& b) {
    if (a.field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      const auto nested = [](const Value& value) -> const Message& {
        return value.index < 0
                   ? value.reflection().GetMessage(value.message, &value.field)
                   : value.reflection().GetRepeatedMessage(value.message, &value.field, value.index);
      };
      return messages(nested(a), nested(b));
    }
    if (same(a, b)) return true;
    std::optional<double> deviation = number_of(a);
    if (deviation) deviation = std::abs(*deviation - *number_of(b));
    return visit_({path_, [&] { return text_of(a); }, [&] { return text_of(b); }, deviation});
  }

  const IgnoredFields& ignored_;
  const std::function<bool(const FieldDifference&)>& visit_;
  FieldPath path_;
};

std::string path_text(const FieldPath& path, bool with_places) {
  std::string text;
  for (const FieldStep& step : path) {
    if (!text.empty()) text += '.';
    text += step.field->name();
    if (step.index >= 0) text.append("[").append(with_places ? std::to_string(step.index) : "").append("]");
  }
  return text;
}

}  // namespace

std::string to_string(const FieldPath& path) {
  return path_text(path, true);
}
std::string general_name(const FieldPath& path) {
  return path_text(path, false);
}

IgnoredFields fields_named(std::initializer_list<const char*> full_names) {
  IgnoredFields fields;
  for (const char* name : full_names) {
    const auto* field = google::protobuf::DescriptorPool::generated_pool()->FindFieldByName(name);
    assert(field);
    fields.insert(field);
  }
  return fields;
}

void for_each_difference(const Message& a, const Message& b, const IgnoredFields& ignored,
                         const std::function<bool(const FieldDifference&)>& visit) {
  assert(a.GetDescriptor() == b.GetDescriptor());
  Walk(ignored, visit).messages(a, b);
}

std::optional<NamedDifference> first_difference(const Message& a, const Message& b,
                                                const IgnoredFields& ignored) {
  std::optional<NamedDifference> first;
  for_each_difference(a, b, ignored, [&](const FieldDifference& difference) {
    first = {to_string(difference.path), difference.a(), difference.b()};
    return false;
  });
  return first;
}

}  // namespace sightline
