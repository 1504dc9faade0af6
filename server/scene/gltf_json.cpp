#include "server/scene/gltf_json.h"

#include <initializer_list>

#include "server/scene/gltf_draco.h"

namespace sightline {
namespace {

using nlohmann::json;

// Counts depth and values as they go by and stops at the first excess. Nothing is stored.
class JsonMeasure : public nlohmann::json_sax<json> {
 public:
  explicit JsonMeasure(const GltfLimits& limits) : limits_(limits) {}

  bool null() override { return count(); }
  bool boolean(bool) override { return count(); }
  bool number_integer(number_integer_t) override { return count(); }
  bool number_unsigned(number_unsigned_t) override { return count(); }
  bool number_float(number_float_t, const string_t&) override { return count(); }
  bool string(string_t&) override { return count(); }
  bool binary(binary_t&) override { return count(); }
  bool key(string_t&) override { return true; }
  bool start_object(std::size_t) override { return enter(); }
  bool start_array(std::size_t) override { return enter(); }
  bool end_object() override { return --depth_, true; }
  bool end_array() override { return --depth_, true; }
  bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception&) override {
    if (!error)
      error = Error{ErrorCode::kDataLoss, "json", "is not valid JSON at byte " + std::to_string(position)};
    return false;
  }

  std::optional<Error> error;

 private:
  bool count() {
    if (++values_ <= limits_.max_json_values) return true;
    error = Error{ErrorCode::kResourceExhausted, "json",
                  "has more than " + std::to_string(limits_.max_json_values) + " values"};
    return false;
  }
  bool enter() {
    if (++depth_ <= limits_.max_json_depth) return count();
    error = Error{ErrorCode::kResourceExhausted, "json",
                  "is nested deeper than " + std::to_string(limits_.max_json_depth)};
    return false;
  }

  const GltfLimits& limits_;
  size_t values_ = 0;
  int depth_ = 0;
};

json keep(const json& object, std::initializer_list<const char*> keys) {
  json kept = json::object();
  for (const char* key : keys)
    if (const auto it = object.find(key); it != object.end()) kept[key] = *it;
  return kept;
}

json keep_each(const json& document, const char* collection, std::initializer_list<const char*> keys) {
  json kept = json::array();
  if (const auto it = document.find(collection); it != document.end())
    for (const json& object : *it) kept.push_back(keep(object, keys));
  return kept;
}

void keep_extension(const json& object, const char* name, json& kept) {
  if (!object.contains("extensions")) return;
  json extensions = keep(object["extensions"], {name});
  if (!extensions.empty()) kept["extensions"] = std::move(extensions);
}

json reduce_primitives(const json& mesh) {
  json primitives = keep_each(mesh, "primitives", {"attributes", "material", "mode", "targets"});
  for (size_t i = 0; i < primitives.size(); ++i) {
    json& attributes = primitives[i]["attributes"];
    attributes.erase(kIndicesAttribute);
    if (const json& primitive = mesh["primitives"][i]; primitive.contains("indices"))
      attributes[kIndicesAttribute] = primitive["indices"];
    keep_extension(mesh["primitives"][i], kDracoExtension, primitives[i]);
  }
  return primitives;
}

json reduce_meshes(const json& document) {
  json meshes = keep_each(document, "meshes", {"name"});
  for (size_t i = 0; i < meshes.size(); ++i)
    meshes[i]["primitives"] = reduce_primitives(document["meshes"][i]);
  return meshes;
}

json reduce_nodes(const json& document) {
  json nodes =
      keep_each(document, "nodes",
                {"name", "children", "mesh", "camera", "skin", "matrix", "translation", "rotation", "scale"});
  for (size_t i = 0; i < nodes.size(); ++i)
    keep_extension(document["nodes"][i], "EXT_mesh_gpu_instancing", nodes[i]);
  return nodes;
}

json reduce_materials(const json& document) {
  json materials = keep_each(document, "materials", {"name", "alphaMode"});
  for (size_t i = 0; i < materials.size(); ++i)
    if (const json& material = document["materials"][i]; material.contains("pbrMetallicRoughness"))
      materials[i]["pbrMetallicRoughness"] = keep(material["pbrMetallicRoughness"], {"baseColorFactor"});
  return materials;
}

// A channel without a target node belongs to an extension and is to be ignored (glTF 2.0 section 3.11).
json reduce_animations(const json& document) {
  json animations = keep_each(document, "animations", {"name"});
  for (size_t i = 0; i < animations.size(); ++i) {
    const json& animation = document["animations"][i];
    animations[i]["samplers"] = keep_each(animation, "samplers", {"input", "output", "interpolation"});
    animations[i]["channels"] = json::array();
    for (const json& channel : animation["channels"])
      if (channel["target"].contains("node"))
        animations[i]["channels"].push_back(
            {{"sampler", channel["sampler"]}, {"target", keep(channel["target"], {"node", "path"})}});
  }
  return animations;
}

}  // namespace

Result<json> parse_gltf_json(std::string_view text, const GltfLimits& limits) {
  if (text.size() > limits.max_json_bytes)
    return fail(ErrorCode::kResourceExhausted, "json",
                "is longer than " + std::to_string(limits.max_json_bytes) + " bytes");
  JsonMeasure measure(limits);
  const bool sound = json::sax_parse(text.begin(), text.end(), &measure);
  if (measure.error) return tl::unexpected(*measure.error);
  if (!sound) return fail(ErrorCode::kDataLoss, "json", "is not valid JSON");
  json document = json::parse(text.begin(), text.end(), nullptr, false);
  if (!document.is_object()) return fail(ErrorCode::kDataLoss, "json", "must be an object");
  return document;
}

json reduce_gltf_json(const json& document) {
  json reduced = keep(document, {"scene"});
  reduced["asset"] = keep(document["asset"], {"version"});
  reduced["bufferViews"] =
      keep_each(document, "bufferViews", {"buffer", "byteOffset", "byteLength", "byteStride"});
  reduced["accessors"] =
      keep_each(document, "accessors",
                {"bufferView", "byteOffset", "componentType", "normalized", "count", "type", "sparse"});
  reduced["cameras"] = keep_each(document, "cameras", {"name", "type", "perspective", "orthographic"});
  reduced["scenes"] = keep_each(document, "scenes", {"name", "nodes"});
  reduced["meshes"] = reduce_meshes(document);
  reduced["nodes"] = reduce_nodes(document);
  reduced["materials"] = reduce_materials(document);
  reduced["animations"] = reduce_animations(document);
  return reduced;
}

}  // namespace sightline
