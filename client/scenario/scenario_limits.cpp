#include "client/scenario/scenario_limits.h"

#include <nlohmann/json.hpp>

namespace sightline {
namespace {

using Json = nlohmann::json;

// extras.sightline of a node when it is the camera, else null. The glTF reader has checked that the extras are JSON.
Json camera_extras(const AssetNode& node) {
  if (node.extras_json.empty()) return nullptr;
  const Json extras = Json::parse(node.extras_json, nullptr, false);
  const auto ours = extras.is_object() ? extras.find("sightline") : extras.end();
  if (!extras.is_object() || ours == extras.end() || !ours->is_object()) return nullptr;
  return ours->value("role", Json()) == "camera" ? *ours : Json(nullptr);
}

Status take(const Json& extras, const AssetNode& node, const char* key, double& value) {
  const auto found = extras.find(key);
  if (found == extras.end()) return {};
  const std::string field = "nodes[" + node.name + "].extras.sightline." + key;
  if (!found->is_number()) return invalid(field, "must be a number");
  value = found->get<double>();
  return {};
}

}  // namespace

Result<CameraLimits> limits_of(const Scenario& scenario) {
  CameraLimits limits;
  for (const AssetNode& node : scenario.asset().nodes) {
    const Json extras = camera_extras(node);
    if (extras.is_null()) continue;
    if (Status done = take(extras, node, "max_speed_mps", limits.max_speed_mps); !done)
      return tl::unexpected(done.error());
    if (Status done = take(extras, node, "max_acceleration_mps2", limits.max_acceleration_mps2); !done)
      return tl::unexpected(done.error());
    if (const Status valid = validate(limits); !valid)
      return invalid("nodes[" + node.name + "].extras.sightline", valid.error().field + ": " + valid.error().message);
  }
  return limits;
}

}  // namespace sightline
