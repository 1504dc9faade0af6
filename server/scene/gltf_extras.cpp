#include "server/scene/gltf_extras.h"

namespace sightline {
namespace {

using nlohmann::json;

Status read_flag(const json& object, const std::string& field, const char* key, bool& flag) {
  const auto it = object.find(key);
  if (it == object.end()) return {};
  if (!it->is_boolean()) return invalid(field + "." + key, "must be true or false");
  flag = it->get<bool>();
  return {};
}

Status read_opacity(const json& object, const std::string& field, float& opacity) {
  const auto it = object.find("opacity");
  if (it == object.end()) return {};
  if (!it->is_number() || !(it->get<double>() >= 0.0 && it->get<double>() <= 1.0))
    return invalid(field + ".opacity", "must be a number in [0, 1]");
  opacity = it->get<float>();
  return {};
}

Status read_layers(const json& object, const std::string& field, uint32_t& layers) {
  const auto it = object.find("layers");
  if (it == object.end()) return {};
  if (!it->is_number_unsigned() || it->get<uint64_t>() > UINT32_MAX)
    return invalid(field + ".layers", "must be a whole number in [0, 4294967295]");
  layers = it->get<uint32_t>();
  return {};
}

}  // namespace

Result<InstanceAttributes> read_instance_attributes(const json& node, const std::string& node_field) {
  InstanceAttributes attributes;
  const auto extras = node.find("extras");
  if (extras == node.end() || !extras->is_object()) return attributes;
  const auto ours = extras->find("sightline");
  if (ours == extras->end()) return attributes;
  const std::string field = node_field + ".extras.sightline";
  if (!ours->is_object()) return invalid(field, "must be an object");
  for (const Status& status :
       {read_layers(*ours, field, attributes.layers), read_opacity(*ours, field, attributes.opacity),
        read_flag(*ours, field, "occludes", attributes.occludes),
        read_flag(*ours, field, "collides", attributes.collides),
        read_flag(*ours, field, "visible", attributes.visible)})
    if (!status) return tl::unexpected(status.error());
  return attributes;
}

}  // namespace sightline
