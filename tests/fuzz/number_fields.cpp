#include "tests/fuzz/number_fields.h"

#include <google/protobuf/reflection.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <concepts>
#include <cstdio>
#include <limits>
#include <numbers>

#include "sightline/options/v1/setting.pb.h"

namespace sightline::test {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;
using Field = google::protobuf::FieldDescriptor;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Around these numbers formulas change: tiny ones vanish in sums or squares, great ones overflow in squares or in
// single precision.
constexpr double kMagnitudes[] = {5e-324,
                                  1e-310,
                                  2.2250738585072014e-308,
                                  1e-300,
                                  1e-200,
                                  1e-160,
                                  1e-120,
                                  1e-60,
                                  1e-45,
                                  1e-38,
                                  1e-30,
                                  1e-20,
                                  1e-12,
                                  1e-9,
                                  1e-7,
                                  1e-6,
                                  1e-5,
                                  1e-4,
                                  1e-3,
                                  0.01,
                                  0.1,
                                  0.5,
                                  1,
                                  2,
                                  10,
                                  100,
                                  1e3,
                                  1e4,
                                  1e5,
                                  1e6,
                                  1e9,
                                  1e12,
                                  1e15,
                                  1e18,
                                  1e20,
                                  1e30,
                                  3e38,
                                  1e60,
                                  1e120,
                                  1e160,
                                  1e200,
                                  1e300,
                                  1.7976931348623157e308};

bool is_number(const Field& field) {
  const auto type = field.cpp_type();
  return type != Field::CPPTYPE_MESSAGE && type != Field::CPPTYPE_STRING && type != Field::CPPTYPE_BOOL &&
         type != Field::CPPTYPE_ENUM;
}

void list_numbers(const Descriptor& type, std::vector<const Field*>& way, std::vector<NumberField>& out) {
  for (int i = 0; i < type.field_count(); ++i) {
    const Field& field = *type.field(i);
    if (is_number(field)) {
      out.push_back({way}), out.back().way.push_back(&field);
    } else if (const Descriptor* inner = field.message_type()) {
      if (std::ranges::count(way, inner, [](const Field* above) { return above->message_type(); }) >= 2) continue;
      way.push_back(&field);
      list_numbers(*inner, way, out);
      way.pop_back();
    }
  }
}

// The ends of an annotated range that are numbers.
std::vector<double> ends_of(const Field& field) {
  const std::string& range = field.options().GetExtension(options::v1::setting).range();
  std::vector<double> ends;
  for (size_t at = 0; at < range.size();) {
    double end = 0;
    const auto [stop, error] = std::from_chars(range.data() + at, range.data() + range.size(), end);
    if (error == std::errc() && (at == 0 || !std::isalnum(static_cast<unsigned char>(range[at - 1]))))
      ends.push_back(end);
    at = error == std::errc() ? static_cast<size_t>(stop - range.data()) : at + 1;
  }
  if (range.find("pi/2") != std::string::npos) ends.push_back(std::numbers::pi / 2);
  return ends;
}

double sign(CounterRandom& random) {
  return random.next_below(4) == 0 ? -1.0 : 1.0;
}

double near(double end, CounterRandom& random) {
  switch (random.next_below(3)) {
    case 0:
      return end;
    case 1:
      return std::nextafter(end, -kInfinity);
    default:
      return std::nextafter(end, kInfinity);
  }
}

double value_for(const Field& field, double present, CounterRandom& random) {
  const std::vector<double> ends = ends_of(field);
  const uint32_t kind = random.next_below(100);
  if (kind < 5) return std::numeric_limits<double>::quiet_NaN();
  if (kind < 8) return random.next_below(2) ? kInfinity : -kInfinity;
  if (kind < 14) return random.next_below(2) ? 0.0 : -0.0;
  if (!ends.empty() && kind < 50) return near(ends[random.next_below(static_cast<uint32_t>(ends.size()))], random);
  if (ends.size() >= 2 && kind < 60) return random.next_in(ends.front(), ends.back());
  if (!ends.empty() && kind < 70) return ends.back() * std::pow(10.0, random.next_in(-12.0, 0.0));
  if (kind < 75 && present != 0) return present * std::pow(10.0, random.next_in(-9.0, 9.0));
  if (kind < 80) return present + random.next_in(-3.0, 3.0);
  if (kind < 90) return sign(random) * std::pow(10.0, random.next_in(-9.0, 9.0));
  return sign(random) * kMagnitudes[random.next_below(std::size(kMagnitudes))];
}

template <typename Whole>
Whole whole_value_for(const Field& field, double present, CounterRandom& random) {
  switch (random.next_below(6)) {
    case 0:
      return std::numeric_limits<Whole>::max();
    case 1:
      return 0;
    case 2:
      return static_cast<Whole>(1) << random.next_below(8 * sizeof(Whole));
    case 3:
      return static_cast<Whole>(present) + random.next_below(3);
    default:
      const double value = value_for(field, present, random);
      return value >= 0 && value < 4e9 ? static_cast<Whole>(value) : random.next_below(70);
  }
}

Message& entered(Message& message, const Field& field, CounterRandom& random, const FillUsual& fill_usual) {
  const Reflection& reflection = *message.GetReflection();
  if (!field.is_repeated()) {
    const bool is_new = !reflection.HasField(message, &field);
    Message& inner = *reflection.MutableMessage(&message, &field);
    if (is_new) fill_usual(inner);
    return inner;
  }
  const int size = reflection.FieldSize(message, &field);
  if (size > 0)
    return *reflection.MutableRepeatedMessage(&message, &field,
                                              static_cast<int>(random.next_below(static_cast<uint32_t>(size))));
  Message& added = *reflection.AddMessage(&message, &field);
  fill_usual(added);
  return added;
}

template <typename Value>
std::string text_of(Value value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", static_cast<double>(value));
  return text;
}

// `make` is given the present value and returns the new one.
template <typename Value, typename Make>
std::string set(Message& message, const Field& field, CounterRandom& random, const Make& make) {
  const Reflection& reflection = *message.GetReflection();
  if (!field.is_repeated()) {
    Value value{};
    if constexpr (std::same_as<Value, double>)
      reflection.SetDouble(&message, &field, value = make(reflection.GetDouble(message, &field)));
    if constexpr (std::same_as<Value, float>)
      reflection.SetFloat(&message, &field, value = make(reflection.GetFloat(message, &field)));
    if constexpr (std::same_as<Value, uint32_t>)
      reflection.SetUInt32(&message, &field, value = make(reflection.GetUInt32(message, &field)));
    if constexpr (std::same_as<Value, uint64_t>)
      reflection.SetUInt64(&message, &field, value = make(static_cast<double>(reflection.GetUInt64(message, &field))));
    return text_of(value);
  }
  auto numbers = reflection.GetMutableRepeatedFieldRef<Value>(&message, &field);
  if (numbers.empty()) numbers.Add(Value{});
  const int at = static_cast<int>(random.next_below(static_cast<uint32_t>(numbers.size())));
  const Value value = make(static_cast<double>(numbers.Get(at)));
  numbers.Set(at, value);
  return text_of(value);
}

}  // namespace

std::string NumberField::path() const {
  std::string path;
  for (const Field* field : way) path += (path.empty() ? "" : ".") + field->name();
  return path;
}

std::vector<NumberField> number_fields(const Descriptor& type) {
  std::vector<NumberField> out;
  std::vector<const Field*> way;
  list_numbers(type, way, out);
  return out;
}

std::string set_number(Message& message, const NumberField& number, CounterRandom& random,
                       const FillUsual& fill_usual) {
  Message* in = &message;
  for (size_t i = 0; i + 1 < number.way.size(); ++i) in = &entered(*in, *number.way[i], random, fill_usual);
  const Field& field = *number.way.back();
  switch (field.cpp_type()) {
    case Field::CPPTYPE_DOUBLE:
      return set<double>(*in, field, random, [&](double present) { return value_for(field, present, random); });
    case Field::CPPTYPE_FLOAT:
      return set<float>(*in, field, random,
                        [&](double present) { return static_cast<float>(value_for(field, present, random)); });
    case Field::CPPTYPE_UINT32:
      return set<uint32_t>(*in, field, random,
                           [&](double present) { return whole_value_for<uint32_t>(field, present, random); });
    case Field::CPPTYPE_UINT64:
      return set<uint64_t>(*in, field, random,
                           [&](double present) { return whole_value_for<uint64_t>(field, present, random); });
    default:
      return "a type that is not tried";
  }
}

std::string not_finite_in(const Message& message) {
  const Reflection& reflection = *message.GetReflection();
  std::vector<const Field*> fields;
  reflection.ListFields(message, &fields);
  for (const Field* field : fields) {
    const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      const auto value = [&]() -> double {
        if (field->cpp_type() == Field::CPPTYPE_DOUBLE)
          return field->is_repeated() ? reflection.GetRepeatedDouble(message, field, i)
                                      : reflection.GetDouble(message, field);
        if (field->cpp_type() == Field::CPPTYPE_FLOAT)
          return field->is_repeated() ? reflection.GetRepeatedFloat(message, field, i)
                                      : reflection.GetFloat(message, field);
        return 0.0;
      };
      // A map's distance is +infinity where there is no occluder.
      const bool may_be_far = field->name() == "distances_m" && value() == kInfinity;
      if (!std::isfinite(value()) && !may_be_far) return field->name();
      if (field->cpp_type() != Field::CPPTYPE_MESSAGE) continue;
      const Message& inner = field->is_repeated() ? reflection.GetRepeatedMessage(message, field, i)
                                                  : reflection.GetMessage(message, field);
      if (const std::string within = not_finite_in(inner); !within.empty()) return field->name() + "." + within;
    }
  }
  return "";
}

}  // namespace sightline::test
