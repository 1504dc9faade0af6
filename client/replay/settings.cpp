#include "client/replay/settings.h"

#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <cassert>
#include <cctype>
#include <charconv>
#include <optional>
#include <string_view>

namespace sightline {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::EnumDescriptor;
using google::protobuf::EnumValueDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

bool is_message(const FieldDescriptor& field) {
  return field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
}

std::string names_of(const Descriptor& message) {
  std::string names;
  for (int i = 0; i < message.field_count(); ++i) {
    const FieldDescriptor& field = *message.field(i);
    names.append(i > 0 ? ", " : "").append(field.name()).append(is_message(field) ? "..." : "");
  }
  return names;
}

// FOLLOW_STAY -> "STAY". The first value of every enum is <PREFIX>UNSPECIFIED.
std::string short_name(const EnumValueDescriptor& value) {
  const std::string& first = value.type()->value(0)->name();
  return value.name().substr(first.size() - std::string_view("UNSPECIFIED").size());
}

// Without UNSPECIFIED, which cannot be asked for.
std::string names_of(const EnumDescriptor& values) {
  std::string names;
  for (int i = 1; i < values.value_count(); ++i)
    names.append(i > 1 ? ", " : "").append(short_name(*values.value(i)));
  return names;
}

std::string upper_case(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

const EnumValueDescriptor* value_named(const EnumDescriptor& values, const std::string& name) {
  const std::string typed = upper_case(name);
  for (int i = 1; i < values.value_count(); ++i)
    if (typed == short_name(*values.value(i)) || typed == values.value(i)->name()) return values.value(i);
  return nullptr;
}

template <typename Number>
std::optional<Number> number_in(const std::string& text) {
  Number number{};
  const char* end = text.data() + text.size();
  const auto [stopped, trouble] = std::from_chars(text.data(), end, number);
  if (trouble != std::errc() || stopped != end) return std::nullopt;
  return number;
}

std::optional<bool> truth_in(const std::string& text) {
  if (text == "true" || text == "1") return true;
  if (text == "false" || text == "0") return false;
  return std::nullopt;
}

// Says what the value must be, if `text` is something else.
std::optional<std::string> trouble_with(const FieldDescriptor& field, const std::string& text) {
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      if (!number_in<double>(text)) return "must be a number";
      return std::nullopt;
    case FieldDescriptor::CPPTYPE_UINT32:
      if (!number_in<uint32_t>(text)) return "must be a whole number, 0 or more";
      return std::nullopt;
    case FieldDescriptor::CPPTYPE_UINT64:
      if (!number_in<uint64_t>(text)) return "must be a whole number, 0 or more";
      return std::nullopt;
    case FieldDescriptor::CPPTYPE_BOOL:
      if (!truth_in(text)) return "must be true or false";
      return std::nullopt;
    case FieldDescriptor::CPPTYPE_ENUM:
      if (!value_named(*field.enum_type(), text)) return "must be one of " + names_of(*field.enum_type());
      return std::nullopt;
    default:
      return "cannot be set";
  }
}

void set_value(const FieldDescriptor& field, const std::string& text, Message& message) {
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return reflection.SetDouble(&message, &field, *number_in<double>(text));
    case FieldDescriptor::CPPTYPE_UINT32:
      return reflection.SetUInt32(&message, &field, *number_in<uint32_t>(text));
    case FieldDescriptor::CPPTYPE_UINT64:
      return reflection.SetUInt64(&message, &field, *number_in<uint64_t>(text));
    case FieldDescriptor::CPPTYPE_BOOL:
      return reflection.SetBool(&message, &field, *truth_in(text));
    case FieldDescriptor::CPPTYPE_ENUM:
      return reflection.SetEnum(&message, &field, value_named(*field.enum_type(), text));
    default:
      assert(false);  // read_replay_setting lets nothing else through
  }
}

void put_into(const ReplaySetting& setting, Message& part) {
  Message* at = &part;
  for (const FieldDescriptor* field : setting.path) {
    if (field == setting.path.back()) return set_value(*field, setting.value, *at);
    at = at->GetReflection()->MutableMessage(at, field);
  }
}

std::vector<std::string> words_of(std::string_view key) {
  std::vector<std::string> words;
  for (size_t dot; (dot = key.find('.')) != std::string_view::npos; key.remove_prefix(dot + 1))
    words.emplace_back(key.substr(0, dot));
  words.emplace_back(key);
  return words;
}

// The message that a key begins in; "settings." may be left out.
const Descriptor& part_of(std::vector<std::string>& words, ReplaySetting::Part& part) {
  using Part = ReplaySetting::Part;
  const auto begins = [&](const char* word) { return words.size() > 1 && words.front() == word; };
  part = begins("limits")   ? Part::kLimits
         : begins("lens")   ? Part::kLens
         : begins("tuning") ? Part::kTuning
                            : Part::kSettings;
  if (part != Part::kSettings || begins("settings")) words.erase(words.begin());
  if (part == Part::kLimits) return *v1::CameraLimits::descriptor();
  if (part == Part::kTuning) return *tuning::v1alpha1::Tuning::descriptor();
  return part == Part::kLens ? *v1::Lens::descriptor() : *v1::Settings::descriptor();
}

Status find_path(const Descriptor& top, const std::vector<std::string>& words, ReplaySetting& setting) {
  const Descriptor* at = &top;
  for (const std::string& word : words) {
    const FieldDescriptor* field = at ? at->FindFieldByName(word) : nullptr;
    if (!at) return invalid(setting.key, "ends before \"" + word + "\": what stands there is a value");
    if (!field) {
      std::string there = "there is no \"" + word + "\" here, only: " + names_of(*at);
      if (setting.path.empty() && setting.part == ReplaySetting::Part::kSettings)
        there += ", tuning..., limits..., lens..., seed";
      return invalid(setting.key, std::move(there));
    }
    setting.path.push_back(field);
    at = is_message(*field) ? field->message_type() : nullptr;
  }
  if (at) return invalid(setting.key, "is a group; name one of its values: " + names_of(*at));
  return {};
}

}  // namespace

Result<ReplaySetting> read_replay_setting(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0)
    return invalid("--set", "must be KEY=VALUE, got \"" + text + "\"");
  ReplaySetting setting;
  setting.key = text.substr(0, equals);
  setting.value = text.substr(equals + 1);
  if (setting.key == "seed") {
    setting.part = ReplaySetting::Part::kSeed;
    setting.path = {v1::OpenSession::descriptor()->FindFieldByName("seed")};
  } else {
    std::vector<std::string> words = words_of(setting.key);
    const Descriptor& part = part_of(words, setting.part);
    if (Status found = find_path(part, words, setting); !found)
      return tl::unexpected(std::move(found.error()));
  }
  if (const auto trouble = trouble_with(*setting.path.back(), setting.value))
    return invalid(setting.key, *trouble + ", got \"" + setting.value + "\"");
  return setting;
}

void put_over(const std::vector<ReplaySetting>& settings, v1::OpenSession& open) {
  for (const ReplaySetting& setting : settings) switch (setting.part) {
      case ReplaySetting::Part::kSettings:
        put_into(setting, *open.mutable_settings());
        break;
      case ReplaySetting::Part::kTuning:
        put_into(setting, *open.mutable_tuning());
        break;
      case ReplaySetting::Part::kLimits:
        put_into(setting, *open.mutable_limits());
        break;
      case ReplaySetting::Part::kLens:
        put_into(setting, *open.mutable_lens());
        break;
      case ReplaySetting::Part::kSeed:
        put_into(setting, open);
        break;
    }
}

// A preset in the tick starts settings and tuning anew, and a lens replaces the former one whole. So what was asked for is put
// over every such tick again. No preset is put where the tick names none: that would end what other ticks set before it.
void put_over(const std::vector<ReplaySetting>& settings, v1::Tick& tick) {
  const bool anew = tick.settings().preset() != v1::Settings::PRESET_UNSPECIFIED;
  for (const ReplaySetting& setting : settings) {
    const bool is_preset = setting.part == ReplaySetting::Part::kSettings &&
                           setting.path.front()->number() == v1::Settings::kPresetFieldNumber;
    if (setting.part == ReplaySetting::Part::kSettings && tick.has_settings() && (anew || !is_preset))
      put_into(setting, *tick.mutable_settings());
    if (setting.part == ReplaySetting::Part::kTuning && (tick.has_tuning() || anew))
      put_into(setting, *tick.mutable_tuning());
    if (setting.part == ReplaySetting::Part::kLimits && tick.has_limits())
      put_into(setting, *tick.mutable_limits());
    if (setting.part == ReplaySetting::Part::kLens && tick.has_lens())
      put_into(setting, *tick.mutable_lens());
  }
}

}  // namespace sightline
