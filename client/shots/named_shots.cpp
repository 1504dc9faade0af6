#include "client/shots/named_shots.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace sightline {
namespace {

std::vector<NamedShot> read_shots() {
  std::vector<NamedShot> shots;
  for (const auto& entry : nlohmann::ordered_json::parse(shots_json()))
    shots.push_back(
        {entry.at("name").get<std::string>(), entry.at("shows").get<std::string>(), entry.at("tick").dump()});
  return shots;
}

void replace_all(std::string& text, std::string_view what, const std::string& by) {
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
    text.replace(at, what.size(), by);
}

Result<v1::Tick> tick_from_json(const std::string& json) {
  v1::Tick tick;
  if (const auto parsed = google::protobuf::util::JsonStringToMessage(json, &tick); !parsed.ok())
    return invalid("shot", std::string(parsed.message()));
  v1::Tick rest = tick;
  rest.clear_shot(), rest.clear_settings();
  if (rest.ByteSizeLong() > 0) return invalid("shot", "must hold \"shot\" and \"settings\" only");
  return tick;
}

}  // namespace

const std::vector<NamedShot>& named_shots() {
  static const std::vector<NamedShot> shots = read_shots();
  return shots;
}

Result<v1::Tick> named_shot(const std::string& name, uint64_t subject, uint64_t other) {
  const auto& shots = named_shots();
  const auto found = std::ranges::find(shots, name, &NamedShot::name);
  if (found == shots.end()) {
    std::string names;
    for (const NamedShot& shot : shots) names += (names.empty() ? "" : ", ") + shot.name;
    return fail(ErrorCode::kNotFound, "shot", "there is no shot " + name + "; there are " + names);
  }
  if (found->needs_subject() && subject == 0) return invalid("subject", name + " needs the id of its subject");
  if (found->needs_other() && other == 0) return invalid("other", name + " needs the id of the other");
  std::string json = found->tick_json;
  replace_all(json, "$subject", std::to_string(subject));
  replace_all(json, "$other", std::to_string(other));
  return tick_from_json(json);
}

Result<v1::Tick> read_shot_text(const std::string& text, uint64_t subject, uint64_t other) {
  return text.starts_with("{") ? tick_from_json(text) : named_shot(text, subject, other);
}

}  // namespace sightline
