// Every key that the reader uses, checked for type, length and reference (glTF 2.0 section 5 and the two
// geometry extensions). The order of the functions is the order of the document's arrays.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string_view>

#include "server/scene/gltf_draco.h"
#include "server/scene/gltf_json.h"
#include "server/scene/gltf_meshopt.h"

namespace sightline {
namespace {

using nlohmann::json;

constexpr uint64_t kMaxInt = std::numeric_limits<int>::max();
constexpr size_t kMaxArrayItems = 1'000'000;  // of any one array of the document
constexpr size_t kMaxMaterials = 65'536;      // "{}" is a valid one, and tinygltf spends 1.5 KB on it

// Extensions that may be required: four that we read, and those that leave every triangle where it is.
constexpr std::array<std::string_view, 14> kSupported = {
    "KHR_mesh_quantization",   "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression", "KHR_draco_mesh_compression",
    "KHR_lights_punctual",     "KHR_xmp_json_ld",
    "KHR_texture_basisu",      "KHR_texture_transform",
    "EXT_texture_webp",        "EXT_texture_avif",
    "MSFT_texture_dds",        "EXT_lights_image_based",
    "EXT_lights_ies",          "KHR_xmp"};

bool supported(std::string_view extension) {
  return extension.starts_with("KHR_materials_") ||
         std::find(kSupported.begin(), kSupported.end(), extension) != kSupported.end();
}

constexpr std::array<std::string_view, 7> kAccessorTypes = {"SCALAR", "VEC2", "VEC3", "VEC4",
                                                            "MAT2",   "MAT3", "MAT4"};

std::string at(const std::string& path, size_t index) {
  return path + "[" + std::to_string(index) + "]";
}
std::string in(const std::string& path, const char* key) {
  return path.empty() ? key : path + "." + key;
}

// Notes the first thing wrong and lets the rest pass. Absent keys are right unless `required` is called
// first.
class JsonCheck {
 public:
  explicit JsonCheck(const json& document) : document_(document) {}

  void complain(std::string field, std::string message, ErrorCode code = ErrorCode::kInvalidArgument) {
    if (!error_) error_ = Error{code, std::move(field), std::move(message)};
  }
  bool failed() const { return error_.has_value(); }
  Status status() const { return error_ ? Status(tl::unexpected(*error_)) : Status(); }

  void required(const json& object, const std::string& path, std::initializer_list<const char*> keys) {
    for (const char* key : keys)
      if (!object.contains(key)) complain(in(path, key), "is missing");
  }

  const json* find(const json& object, const char* key) const {
    const auto it = object.find(key);
    return it == object.end() ? nullptr : &*it;
  }

  // The member as an object, or null (and a complaint when it is something else).
  const json* object(const json& parent, const std::string& path, const char* key) {
    const json* value = find(parent, key);
    if (value && !value->is_object()) return complain(in(path, key), "must be an object"), nullptr;
    return value;
  }
  const json* array(const json& parent, const std::string& path, const char* key) {
    const json* value = find(parent, key);
    if (value && !value->is_array()) return complain(in(path, key), "must be an array"), nullptr;
    if (value && value->size() > kMaxArrayItems)
      return complain(in(path, key), "has more than 1000000 items", ErrorCode::kResourceExhausted), nullptr;
    return value;
  }
  // Calls visit(item, path) for each item of an array of objects.
  template <typename Visit>
  void each(const json& parent, const std::string& path, const char* key, Visit visit) {
    const json* items = array(parent, path, key);
    if (!items) return;
    for (size_t i = 0; i < items->size() && !failed(); ++i) {
      const std::string item_path = at(in(path, key), i);
      if (!(*items)[i].is_object()) return complain(item_path, "must be an object");
      visit((*items)[i], item_path);
    }
  }

  void string(const json& parent, const std::string& path, const char* key) {
    if (const json* value = find(parent, key); value && !value->is_string())
      complain(in(path, key), "must be a string");
  }
  void one_of(const json& parent, const std::string& path, const char* key,
              std::span<const std::string_view> words) {
    const json* value = find(parent, key);
    if (!value) return;
    if (!value->is_string() ||
        std::find(words.begin(), words.end(), value->get_ref<const std::string&>()) == words.end())
      complain(in(path, key), "is not a word that glTF knows here");
  }
  void boolean(const json& parent, const std::string& path, const char* key) {
    if (const json* value = find(parent, key); value && !value->is_boolean())
      complain(in(path, key), "must be true or false");
  }
  void whole(const json& parent, const std::string& path, const char* key, uint64_t low, uint64_t high) {
    if (const json* value = find(parent, key)) whole_value(*value, in(path, key), low, high);
  }
  void whole_value(const json& value, const std::string& path, uint64_t low, uint64_t high) {
    if (!value.is_number_unsigned() || value.get<uint64_t>() < low || value.get<uint64_t>() > high)
      complain(path, "must be a whole number in [" + std::to_string(low) + ", " + std::to_string(high) + "]");
  }
  void numbers(const json& parent, const std::string& path, const char* key, size_t count) {
    const json* values = array(parent, path, key);
    if (!values) return;
    if (values->size() != count)
      return complain(in(path, key), "must have " + std::to_string(count) + " numbers");
    for (size_t i = 0; i < count; ++i)
      if (!(*values)[i].is_number() || !std::isfinite((*values)[i].get<double>()))
        complain(at(in(path, key), i), "must be a finite number");
  }
  // A number above 0.
  void positive(const json& parent, const std::string& path, const char* key) {
    const json* value = find(parent, key);
    if (value && (!value->is_number() || !(value->get<double>() > 0.0)))
      complain(in(path, key), "must be a number above 0");
  }

  // An index into the document's own array `collection`, or into `items`.
  void index(const json& parent, const std::string& path, const char* key, const char* collection) {
    if (const json* value = find(parent, key))
      index_value(*value, in(path, key), collection, size_of(collection));
  }
  void index_value(const json& value, const std::string& path, const char* collection, size_t size) {
    if (!value.is_number_unsigned() || value.get<uint64_t>() >= size)
      complain(path,
               "must be an index into " + std::string(collection) + ", which has " + std::to_string(size));
  }
  void indices(const json& parent, const std::string& path, const char* key, const char* collection) {
    const json* values = array(parent, path, key);
    for (size_t i = 0; values && i < values->size() && !failed(); ++i)
      index_value((*values)[i], at(in(path, key), i), collection, size_of(collection));
  }
  // {"POSITION": 3, ...}
  void attributes(const json& parent, const std::string& path, const char* key) {
    const json* values = object(parent, path, key);
    if (!values) return;
    for (const auto& [name, value] : values->items())
      index_value(value, in(in(path, key), name.c_str()), "accessors", size_of("accessors"));
  }

 private:
  size_t size_of(const char* collection) const {
    const json* items = find(document_, collection);
    return items && items->is_array() ? items->size() : 0;
  }

  const json& document_;
  std::optional<Error> error_;
};

void check_version(JsonCheck& check, const json& document) {
  const json* asset = check.object(document, "", "asset");
  if (!asset) return check.complain("asset", "is missing");
  check.required(*asset, "asset", {"version"});
  check.string(*asset, "asset", "version");
  check.string(*asset, "asset", "minVersion");
  if (check.failed()) return;
  if (!(*asset)["version"].get<std::string>().starts_with("2."))
    check.complain("asset.version", "must be 2.x", ErrorCode::kUnsupported);
  if (asset->contains("minVersion") && (*asset)["minVersion"] != "2.0")
    check.complain("asset.minVersion", "must be 2.0", ErrorCode::kUnsupported);
}

void check_extensions(JsonCheck& check, const json& document) {
  for (const char* key : {"extensionsUsed", "extensionsRequired"}) {
    const json* names = check.array(document, "", key);
    for (size_t i = 0; names && i < names->size(); ++i)
      if (!(*names)[i].is_string()) return check.complain(at(key, i), "must be a string");
  }
  if (check.failed() || !document.contains("extensionsRequired")) return;
  const json& required = document["extensionsRequired"];
  for (size_t i = 0; i < required.size(); ++i)
    if (const auto name = required[i].get<std::string>(); !supported(name))
      check.complain(at("extensionsRequired", i), "the file needs " + name + ", which is not supported",
                     ErrorCode::kUnsupported);
}

constexpr std::array<std::string_view, 3> kMeshoptModes = {"ATTRIBUTES", "TRIANGLES", "INDICES"};
constexpr std::array<std::string_view, 4> kMeshoptFilters = {"NONE", "OCTAHEDRAL", "QUATERNION",
                                                             "EXPONENTIAL"};

// What the extension says of its own layout; the values themselves are known to be there and of the right type.
void check_meshopt_layout(JsonCheck& check, const json& view, const json& packing, const std::string& path) {
  const auto stride = packing["byteStride"].get<uint64_t>(), count = packing["count"].get<uint64_t>();
  const std::string mode = packing["mode"], filter = packing.value("filter", "NONE");
  const bool attributes = mode == "ATTRIBUTES";
  const bool stride_suits_mode = attributes ? stride % 4 == 0 : stride == 2 || stride == 4;
  const bool stride_suits_filter =
      filter == "OCTAHEDRAL" ? stride == 4 || stride == 8 : filter != "QUATERNION" || stride == 8;
  if (!stride_suits_mode || !stride_suits_filter)
    check.complain(path + ".byteStride", "does not suit the mode and the filter");
  if (mode == "TRIANGLES" && count % 3 != 0) check.complain(path + ".count", "must be a multiple of 3");
  if (!attributes && filter != "NONE") check.complain(path + ".filter", "is for attributes only");
  if (view.value("byteStride", stride) != stride)
    check.complain(path + ".byteStride", "differs from the view's");
  if (view["byteLength"].get<uint64_t>() != stride * count)
    check.complain(path, "byteStride times count is not the view's byteLength");
}

void check_meshopt(JsonCheck& check, const json& view, const std::string& view_path) {
  const json* extensions = check.object(view, view_path, "extensions");
  if (!extensions) return;
  const json* packing = check.object(*extensions, view_path + ".extensions", kMeshoptExtension);
  if (!packing) return;
  const std::string path = view_path + ".extensions." + kMeshoptExtension;
  check.required(*packing, path, {"buffer", "byteLength", "byteStride", "count", "mode"});
  check.index(*packing, path, "buffer", "buffers");
  check.whole(*packing, path, "byteOffset", 0, uint64_t{1} << 40);
  check.whole(*packing, path, "byteLength", 1, uint64_t{1} << 40);
  check.whole(*packing, path, "byteStride", 2, 256);
  check.whole(*packing, path, "count", 1, kMaxInt);
  check.one_of(*packing, path, "mode", kMeshoptModes);
  check.one_of(*packing, path, "filter", kMeshoptFilters);
  if (!check.failed()) check_meshopt_layout(check, view, *packing, path);
}

void check_buffers(JsonCheck& check, const json& document) {
  check.each(document, "", "buffers", [&](const json& buffer, const std::string& path) {
    check.required(buffer, path, {"byteLength"});
    check.whole(buffer, path, "byteLength", 1, uint64_t{1} << 40);
    check.string(buffer, path, "uri");
  });
  check.each(document, "", "bufferViews", [&](const json& view, const std::string& path) {
    check.required(view, path, {"buffer", "byteLength"});
    check.index(view, path, "buffer", "buffers");
    check.whole(view, path, "byteOffset", 0, uint64_t{1} << 40);
    check.whole(view, path, "byteLength", 1, uint64_t{1} << 40);
    check.whole(view, path, "byteStride", 4, 252);
    if (!check.failed() && view.value("byteStride", 4u) % 4 != 0)
      check.complain(path + ".byteStride", "must be a multiple of 4");
    check_meshopt(check, view, path);
  });
}

void check_component_type(JsonCheck& check, const json& object, const std::string& path) {
  check.required(object, path, {"componentType"});
  check.whole(object, path, "componentType", 5120, 5126);
  if (!check.failed() && object["componentType"] == 5124)
    check.complain(path + ".componentType", "5124 is not a component type of glTF");
}

void check_sparse(JsonCheck& check, const json& accessor, const std::string& accessor_path) {
  const json* sparse = check.object(accessor, accessor_path, "sparse");
  if (!sparse) return;
  const std::string path = accessor_path + ".sparse";
  check.required(*sparse, path, {"count", "indices", "values"});
  check.whole(*sparse, path, "count", 1, kMaxInt);
  for (const char* key : {"indices", "values"}) {
    const json* part = check.object(*sparse, path, key);
    if (!part) return;
    check.required(*part, in(path, key), {"bufferView"});
    check.index(*part, in(path, key), "bufferView", "bufferViews");
    check.whole(*part, in(path, key), "byteOffset", 0, kMaxInt);
  }
  check_component_type(check, (*sparse)["indices"], path + ".indices");
}

void check_accessors(JsonCheck& check, const json& document) {
  check.each(document, "", "accessors", [&](const json& accessor, const std::string& path) {
    check.required(accessor, path, {"count", "type"});
    check.index(accessor, path, "bufferView", "bufferViews");
    check.whole(accessor, path, "byteOffset", 0, uint64_t{1} << 40);
    check_component_type(check, accessor, path);
    check.boolean(accessor, path, "normalized");
    check.whole(accessor, path, "count", 1, kMaxInt);
    check.one_of(accessor, path, "type", kAccessorTypes);
    if (!check.failed()) check_sparse(check, accessor, path);
  });
}

void check_draco(JsonCheck& check, const json& primitive, const std::string& primitive_path) {
  const json* extensions = check.object(primitive, primitive_path, "extensions");
  if (!extensions) return;
  const json* packing = check.object(*extensions, primitive_path + ".extensions", kDracoExtension);
  if (!packing) return;
  const std::string path = primitive_path + ".extensions." + kDracoExtension;
  check.required(*packing, path, {"bufferView", "attributes"});
  check.index(*packing, path, "bufferView", "bufferViews");
  const json* attributes = check.object(*packing, path, "attributes");
  if (!attributes) return;
  check.required(*attributes, path + ".attributes", {"POSITION"});
  for (const auto& [name, id] : attributes->items())
    check.whole_value(id, in(path + ".attributes", name.c_str()), 0, kMaxInt);
  if (const int mode = check.failed() ? 4 : primitive.value("mode", 4); mode != 4 && mode != 5)
    check.complain(primitive_path + ".mode", "must be triangles or a triangle strip where Draco packs them");
}

void check_meshes(JsonCheck& check, const json& document) {
  check.each(document, "", "meshes", [&](const json& mesh, const std::string& mesh_path) {
    check.string(mesh, mesh_path, "name");
    check.required(mesh, mesh_path, {"primitives"});
    check.each(mesh, mesh_path, "primitives", [&](const json& primitive, const std::string& path) {
      check.required(primitive, path, {"attributes"});
      check.attributes(primitive, path, "attributes");
      check.index(primitive, path, "indices", "accessors");
      check.index(primitive, path, "material", "materials");
      check.whole(primitive, path, "mode", 0, 6);
      check.array(primitive, path, "targets");
      check_draco(check, primitive, path);
    });
  });
}

void check_instancing(JsonCheck& check, const json& node, const std::string& node_path) {
  const json* extensions = check.object(node, node_path, "extensions");
  if (!extensions) return;
  const std::string path = node_path + ".extensions";
  const json* instancing = check.object(*extensions, path, "EXT_mesh_gpu_instancing");
  if (!instancing) return;
  check.required(*instancing, path + ".EXT_mesh_gpu_instancing", {"attributes"});
  check.attributes(*instancing, path + ".EXT_mesh_gpu_instancing", "attributes");
}

void check_nodes(JsonCheck& check, const json& document, const GltfLimits& limits) {
  if (const json* nodes = check.array(document, "", "nodes"); nodes && nodes->size() > limits.max_nodes)
    check.complain("nodes", "more than " + std::to_string(limits.max_nodes), ErrorCode::kResourceExhausted);
  check.each(document, "", "nodes", [&](const json& node, const std::string& path) {
    check.string(node, path, "name");
    check.indices(node, path, "children", "nodes");
    check.index(node, path, "mesh", "meshes");
    check.index(node, path, "camera", "cameras");
    check.index(node, path, "skin", "skins");
    check.numbers(node, path, "matrix", 16);
    check.numbers(node, path, "translation", 3);
    check.numbers(node, path, "rotation", 4);
    check.numbers(node, path, "scale", 3);
    check_instancing(check, node, path);
  });
  check.index(document, "", "scene", "scenes");
  check.each(document, "", "scenes", [&](const json& scene, const std::string& path) {
    check.string(scene, path, "name");
    check.indices(scene, path, "nodes", "nodes");
  });
}

void check_cameras(JsonCheck& check, const json& document) {
  check.each(document, "", "cameras", [&](const json& camera, const std::string& path) {
    check.required(camera, path, {"type"});
    check.string(camera, path, "type");
    if (check.failed()) return;
    const bool perspective = camera["type"] == "perspective";
    if (!perspective && camera["type"] != "orthographic")
      return check.complain(path + ".type", "must be perspective or orthographic");
    const char* key = perspective ? "perspective" : "orthographic";
    check.required(camera, path, {key});
    const json* lens = check.object(camera, path, key);
    if (!lens) return;
    for (const char* name : {"yfov", "aspectRatio", "znear", "zfar"})
      if (perspective) check.positive(*lens, in(path, key), name);
    if (perspective)
      check.required(*lens, in(path, key), {"yfov", "znear"});
    else
      check.required(*lens, in(path, key), {"xmag", "ymag", "znear", "zfar"});
  });
}

void check_materials(JsonCheck& check, const json& document) {
  if (const json* materials = check.array(document, "", "materials");
      materials && materials->size() > kMaxMaterials)
    return check.complain("materials", "more than " + std::to_string(kMaxMaterials),
                          ErrorCode::kResourceExhausted);
  check.each(document, "", "materials", [&](const json& material, const std::string& path) {
    check.string(material, path, "name");
    check.string(material, path, "alphaMode");
    if (const json* pbr = check.object(material, path, "pbrMetallicRoughness"))
      check.numbers(*pbr, path + ".pbrMetallicRoughness", "baseColorFactor", 4);
  });
}

void check_channel(JsonCheck& check, const json& channel, const std::string& path, const json& samplers) {
  check.required(channel, path, {"sampler", "target"});
  const json* target = check.object(channel, path, "target");
  if (!target || check.failed()) return;
  check.index_value(channel["sampler"], path + ".sampler", "samplers", samplers.size());
  check.index(*target, path + ".target", "node", "nodes");
  check.required(*target, path + ".target", {"path"});
  check.string(*target, path + ".target", "path");
}

void check_animations(JsonCheck& check, const json& document) {
  check.each(document, "", "animations", [&](const json& animation, const std::string& path) {
    check.string(animation, path, "name");
    check.required(animation, path, {"samplers", "channels"});
    check.each(animation, path, "samplers", [&](const json& sampler, const std::string& sampler_path) {
      check.required(sampler, sampler_path, {"input", "output"});
      check.index(sampler, sampler_path, "input", "accessors");
      check.index(sampler, sampler_path, "output", "accessors");
      check.string(sampler, sampler_path, "interpolation");
    });
    check.each(animation, path, "channels", [&](const json& channel, const std::string& channel_path) {
      check_channel(check, channel, channel_path, animation["samplers"]);
    });
  });
}

}  // namespace

Status check_gltf_json(const json& document, const GltfLimits& limits) {
  JsonCheck check(document);
  check_version(check, document);
  check_extensions(check, document);
  check_buffers(check, document);
  check_accessors(check, document);
  check_meshes(check, document);
  check_nodes(check, document, limits);
  check_cameras(check, document);
  check_materials(check, document);
  check_animations(check, document);
  check.array(document, "", "skins");
  return check.status();
}

}  // namespace sightline
