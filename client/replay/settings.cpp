#include "client/replay/settings.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/text_format.h>

#include <algorithm>
#include <cctype>
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

// Value 0 means "unspecified" and cannot be set.
std::string names_of(const EnumDescriptor& values) {
  std::string names;
  for (int i = 1; i < values.value_count(); ++i) names.append(i > 1 ? ", " : "").append(short_name(*values.value(i)));
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

// Keeps protobuf's parser from logging.
class Quiet final : public google::protobuf::io::ErrorCollector {
 public:
  void AddError(int, google::protobuf::io::ColumnNumber, const std::string&) override {}
};

// Sets the field of `message` from the text of a value. False: it is none of the field's type.
bool set_value(const FieldDescriptor& field, const std::string& text, Message& message) {
  Quiet quiet;
  google::protobuf::TextFormat::Parser parser;
  parser.RecordErrorsTo(&quiet);
  const bool is_number = field.cpp_type() <= FieldDescriptor::CPPTYPE_FLOAT;
  if (is_number && text.find_first_not_of("0123456789+-.eE") != std::string::npos) return false;
  std::string value = text;
  if (field.type() == FieldDescriptor::TYPE_ENUM) {
    const EnumValueDescriptor* known = value_named(*field.enum_type(), text);
    if (!known) return false;
    value = known->name();
  }
  return parser.ParseFieldValueFromString(value, &field, &message);
}

// The rule for the value of a field, for error messages.
std::string wanted_of(const FieldDescriptor& field) {
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return "must be a number";
    case FieldDescriptor::CPPTYPE_UINT32:
    case FieldDescriptor::CPPTYPE_UINT64:
      return "must be a whole number, 0 or more";
    case FieldDescriptor::CPPTYPE_BOOL:
      return "must be true or false";
    case FieldDescriptor::CPPTYPE_ENUM:
      return "must be one of " + names_of(*field.enum_type());
    default:
      return "cannot be set";
  }
}

// The message that a setting is in.
Message& part_of(const ReplaySetting& setting, v1::OpenSession& open) {
  switch (setting.part) {
    case ReplaySetting::Part::kSettings:
      return *open.mutable_settings();
    case ReplaySetting::Part::kTuning:
      return *open.mutable_tuning();
    case ReplaySetting::Part::kLimits:
      return *open.mutable_limits();
    case ReplaySetting::Part::kLens:
      return *open.mutable_lens();
    case ReplaySetting::Part::kSeed:
      break;
  }
  return open;
}

bool put_into(const ReplaySetting& setting, Message& part) {
  Message* at = &part;
  for (const FieldDescriptor* field : setting.path) {
    if (field == setting.path.back()) return set_value(*field, setting.value, *at);
    at = at->GetReflection()->MutableMessage(at, field);
  }
  return false;
}

std::vector<std::string> words_of(std::string_view key) {
  std::vector<std::string> words;
  for (size_t dot; (dot = key.find('.')) != std::string_view::npos; key.remove_prefix(dot + 1))
    words.emplace_back(key.substr(0, dot));
  words.emplace_back(key);
  return words;
}

// The message that a key begins in. "settings." may be left out.
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
  if (equals == std::string::npos || equals == 0) return invalid("--set", "must be KEY=VALUE, got \"" + text + "\"");
  ReplaySetting setting;
  setting.key = text.substr(0, equals);
  setting.value = text.substr(equals + 1);
  if (setting.key == "seed") {
    setting.part = ReplaySetting::Part::kSeed;
    setting.path = {v1::OpenSession::descriptor()->FindFieldByName("seed")};
  } else {
    std::vector<std::string> words = words_of(setting.key);
    const Descriptor& part = part_of(words, setting.part);
    if (Status found = find_path(part, words, setting); !found) return tl::unexpected(std::move(found.error()));
  }
  v1::OpenSession trial;
  if (!put_into(setting, part_of(setting, trial)))
    return invalid(setting.key, wanted_of(*setting.path.back()) + ", got \"" + setting.value + "\"");
  return setting;
}

void put_over(const std::vector<ReplaySetting>& settings, v1::OpenSession& open) {
  for (const ReplaySetting& setting : settings) put_into(setting, part_of(setting, open));
}

// A preset in a tick resets all settings and tuning, and a lens replaces the whole former lens. So the changed settings
// are added again to every such tick. A preset is only changed where the tick names one: otherwise it would reset what
// earlier ticks set.
void put_over(const std::vector<ReplaySetting>& settings, v1::Tick& tick) {
  const bool anew = tick.settings().preset() != v1::Settings::PRESET_UNSPECIFIED;
  for (const ReplaySetting& setting : settings) {
    const bool is_preset = setting.part == ReplaySetting::Part::kSettings &&
                           setting.path.front()->number() == v1::Settings::kPresetFieldNumber;
    if (setting.part == ReplaySetting::Part::kSettings && tick.has_settings() && (anew || !is_preset))
      put_into(setting, *tick.mutable_settings());
    if (setting.part == ReplaySetting::Part::kTuning && (tick.has_tuning() || anew))
      put_into(setting, *tick.mutable_tuning());
    if (setting.part == ReplaySetting::Part::kLimits && tick.has_limits()) put_into(setting, *tick.mutable_limits());
    if (setting.part == ReplaySetting::Part::kLens && tick.has_lens()) put_into(setting, *tick.mutable_lens());
  }
}

}  // namespace sightline
