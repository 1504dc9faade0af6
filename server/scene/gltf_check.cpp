// A table of every member of a glTF document that the reader uses: type, range and reference (glTF 2.0 section 5 and
// the geometry extensions). Rules that do not fit the table are separate functions.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "server/scene/gltf_draco.h"
#include "server/scene/gltf_json.h"
#include "server/scene/gltf_meshopt.h"

namespace sightline {
namespace {

using nlohmann::json;

constexpr uint64_t kMaxInt = std::numeric_limits<int>::max();
constexpr uint64_t kMaxOffset = uint64_t{1} << 40;
constexpr uint64_t kMaxItems = 1'000'000;   // of any one array of the document
constexpr uint64_t kMaxMaterials = 65'536;  // "{}" is a valid one, and tinygltf spends 1.5 KB on it

std::string at(const std::string& path, size_t index) {
  return path + "[" + std::to_string(index) + "]";
}
std::string in(const std::string& path, const std::string& key) {
  return path.empty() ? key : path + "." + key;
}

class JsonCheck;
// Checks an object whose members have passed; may change the copy.
using Finish = void (*)(JsonCheck& check, const json& from, const std::string& path, json& copy);

enum class Kind {
  kString,
  kBoolean,
  kFlag,  // true, false, 1 or 0: older versions of Blender write True as 1
  kNumber,
  kPositive,     // a number above 0
  kShare,        // a number in [0, 1]
  kWhole,        // a whole number in [low, high]
  kWord,         // one of `words`
  kIndex,        // into the document's array `collection`
  kIndexByName,  // an object of them: {"POSITION": 3, ...}
  kWholeByName,
  kObject,
  kNumbers,  // an array of `high` finite numbers
  kIndices,
  kStrings,
  kObjects,  // an array of at most `high`
  kArray,    // of anything
};

struct Member {
  const char* key;
  Kind kind;
  uint64_t low = 0, high = 0;
  const char* collection = nullptr;
  std::span<const std::string_view> words = {};
  std::span<const Member> members = {};
  Finish finish = nullptr;
  bool required = false;
  bool copied = true;
};

constexpr Member plain(const char* key, Kind kind) {
  return {.key = key, .kind = kind};
}
constexpr Member text(const char* key) {
  return plain(key, Kind::kString);
}
constexpr Member whole(const char* key, uint64_t low, uint64_t high) {
  return {.key = key, .kind = Kind::kWhole, .low = low, .high = high};
}
constexpr Member numbers(const char* key, uint64_t count) {
  return {.key = key, .kind = Kind::kNumbers, .high = count};
}
constexpr Member word(const char* key, std::span<const std::string_view> words) {
  return {.key = key, .kind = Kind::kWord, .words = words};
}
constexpr Member index(const char* key, const char* collection) {
  return {.key = key, .kind = Kind::kIndex, .collection = collection};
}
constexpr Member indices(const char* key, const char* collection) {
  return {.key = key, .kind = Kind::kIndices, .collection = collection};
}
constexpr Member accessors_by_name(const char* key) {
  return {.key = key, .kind = Kind::kIndexByName, .collection = "accessors"};
}
constexpr Member object(const char* key, std::span<const Member> members, Finish finish = nullptr) {
  return {.key = key, .kind = Kind::kObject, .members = members, .finish = finish};
}
constexpr Member objects(const char* key, std::span<const Member> members, Finish finish = nullptr,
                         uint64_t most = kMaxItems) {
  return {.key = key, .kind = Kind::kObjects, .high = most, .members = members, .finish = finish};
}
constexpr Member required(Member member) {
  member.required = true;
  return member;
}
// Checked, but kept from tinygltf.
constexpr Member withheld(Member member) {
  member.copied = false;
  return member;
}

// Walks a document along the table. Notes the first thing that is wrong.
class JsonCheck {
 public:
  JsonCheck(const json& document, WorkLimit* work) : document_(document), work_(work) {}

  void complain(std::string field, std::string message, ErrorCode code = ErrorCode::kInvalidArgument) {
    if (!error_) error_ = Error{code, std::move(field), std::move(message)};
  }
  bool failed() const { return error_.has_value(); }
  const std::optional<Error>& error() const { return error_; }

  // Returns the copy of an object.
  json walk(const json& from, const std::string& path, std::span<const Member> members, Finish finish) {
    json copy = json::object();
    for (const Member& member : members) {
      if (failed()) return copy;
      const auto value = from.find(member.key);
      if (value == from.end()) {
        if (member.required) complain(in(path, member.key), "is missing");
        continue;
      }
      json checked = check(*value, in(path, member.key), member);
      if (member.copied) copy[member.key] = std::move(checked);
    }
    if (finish && !failed()) finish(*this, from, path, copy);
    return copy;
  }

  void check_index(const json& value, const std::string& path, const char* collection, size_t size) {
    if (!value.is_number_unsigned() || value.get<uint64_t>() >= size)
      complain(path, "must be an index into " + std::string(collection) + ", which has " + std::to_string(size));
  }

 private:
  json check(const json& value, const std::string& path, const Member& member) {
    switch (member.kind) {
      case Kind::kString:
        return expect(value.is_string(), value, path, "must be a string");
      case Kind::kBoolean:
        return expect(value.is_boolean(), value, path, "must be true or false");
      case Kind::kFlag:
        return expect(value.is_boolean() || value == 0 || value == 1, value, path, "must be true or false");
      case Kind::kNumber:
        return expect(value.is_number(), value, path, "must be a number");
      case Kind::kPositive:
        return expect(value.is_number() && value.get<double>() > 0.0, value, path, "must be a number above 0");
      case Kind::kShare:
        return expect(value.is_number() && value.get<double>() >= 0.0 && value.get<double>() <= 1.0, value, path,
                      "must be a number in [0, 1]");
      case Kind::kWhole:
        return check_whole(value, path, member), value;
      case Kind::kWord:
        return expect(value.is_string() &&
                          std::ranges::find(member.words, value.get_ref<const std::string&>()) != member.words.end(),
                      value, path, "is not one of the words that glTF allows here");
      case Kind::kIndex:
        return check_index(value, path, member), value;
      case Kind::kIndexByName:
      case Kind::kWholeByName:
        return check_by_name(value, path, member);
      case Kind::kObject:
        if (!value.is_object()) return expect(false, value, path, "must be an object");
        return walk(value, path, member.members, member.finish);
      default:
        return check_array(value, path, member);
    }
  }

  json check_by_name(const json& value, const std::string& path, const Member& member) {
    if (!value.is_object()) return expect(false, value, path, "must be an object");
    for (const auto& [name, item] : value.items())
      if (member.kind == Kind::kIndexByName)
        check_index(item, in(path, name), member);
      else
        check_whole(item, in(path, name), member);
    return value;
  }

  json check_array(const json& value, const std::string& path, const Member& member) {
    if (!value.is_array()) return expect(false, value, path, "must be an array");
    const uint64_t most = member.kind == Kind::kObjects ? member.high : kMaxItems;
    if (value.size() > most)
      complain(path, "has more than " + std::to_string(most) + " items", ErrorCode::kResourceExhausted);
    if (member.kind == Kind::kNumbers && value.size() != member.high)
      complain(path, "must have " + std::to_string(member.high) + " numbers");
    if (member.kind == Kind::kArray) return value;
    json copy = json::array();
    for (size_t i = 0; i < value.size() && !failed(); ++i) {
      copy.push_back(check_item(value[i], at(path, i), member));
      if (work_.ends()) error_ = work_.limit()->error();
    }
    return copy;
  }

  json check_item(const json& value, const std::string& path, const Member& member) {
    switch (member.kind) {
      case Kind::kNumbers:
        return expect(value.is_number() && std::isfinite(value.get<double>()), value, path, "must be a finite number");
      case Kind::kIndices:
        return check_index(value, path, member), value;
      case Kind::kStrings:
        return expect(value.is_string(), value, path, "must be a string");
      default:
        if (!value.is_object()) return expect(false, value, path, "must be an object");
        return walk(value, path, member.members, member.finish);
    }
  }

  void check_whole(const json& value, const std::string& path, const Member& member) {
    if (!value.is_number_unsigned() || value.get<uint64_t>() < member.low || value.get<uint64_t>() > member.high)
      complain(path,
               "must be a whole number in [" + std::to_string(member.low) + ", " + std::to_string(member.high) + "]");
  }
  void check_index(const json& value, const std::string& path, const Member& member) {
    const auto items = document_.find(member.collection);
    check_index(value, path, member.collection, items != document_.end() && items->is_array() ? items->size() : 0);
  }
  const json& expect(bool holds, const json& value, const std::string& path, const char* message) {
    if (!holds) complain(path, message);
    return value;
  }

  const json& document_;
  WorkLimit::Part work_;
  std::optional<Error> error_;
};

// --- asset and extensions
// ----------------------------------------------------------------------------------------------

// Extensions that may be required: six that the reader knows, and those that leave every triangle where it is.
constexpr std::array<std::string_view, 16> kSupported = {
    "KHR_mesh_quantization",      "EXT_mesh_gpu_instancing", "EXT_meshopt_compression", "KHR_meshopt_compression",
    "KHR_draco_mesh_compression", "KHR_node_visibility",     "KHR_lights_punctual",     "KHR_xmp_json_ld",
    "KHR_texture_basisu",         "KHR_texture_transform",   "EXT_texture_webp",        "EXT_texture_avif",
    "MSFT_texture_dds",           "EXT_lights_image_based",  "EXT_lights_ies",          "KHR_xmp"};

void check_version(JsonCheck& check, const json& asset, const std::string&, json&) {
  if (!asset["version"].get<std::string>().starts_with("2."))
    check.complain("asset.version", "must be 2.x", ErrorCode::kUnsupported);
  if (asset.contains("minVersion") && !asset["minVersion"].get<std::string>().starts_with("2."))
    check.complain("asset.minVersion", "must be 2.x", ErrorCode::kUnsupported);
}

void check_required_extensions(JsonCheck& check, const json& document, const std::string&, json&) {
  if (!document.contains("extensionsRequired")) return;
  const json& names = document["extensionsRequired"];
  for (size_t i = 0; i < names.size(); ++i) {
    const auto name = names[i].get<std::string>();
    if (!name.starts_with("KHR_materials_") && std::ranges::find(kSupported, name) == kSupported.end())
      check.complain(at("extensionsRequired", i), "the file needs " + name + ", which is not supported",
                     ErrorCode::kUnsupported);
  }
}

constexpr Member kAsset[] = {required(text("version")), withheld(text("minVersion"))};
constexpr Member kHead[] = {required(object("asset", kAsset, check_version)), plain("extensionsUsed", Kind::kStrings),
                            plain("extensionsRequired", Kind::kStrings)};

// --- buffers and accessors
// ---------------------------------------------------------------------------------------------

constexpr std::array<std::string_view, 7> kAccessorTypes = {"SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"};
constexpr std::array<std::string_view, 3> kMeshoptModes = {"ATTRIBUTES", "TRIANGLES", "INDICES"};
constexpr std::array<std::string_view, 5> kMeshoptFilters = {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL",
                                                             "COLOR"};

// The rules of the extension for the layout of its stream.
void check_meshopt_layout(JsonCheck& check, const json& view, const json& packing, const std::string& path) {
  const auto stride = packing["byteStride"].get<uint64_t>(), count = packing["count"].get<uint64_t>();
  const std::string mode = packing["mode"], filter = packing.value("filter", "NONE");
  const bool attributes = mode == "ATTRIBUTES";
  const bool stride_suits_mode = attributes ? stride % 4 == 0 : stride == 2 || stride == 4;
  const bool stride_suits_filter = filter == "OCTAHEDRAL" || filter == "COLOR" ? stride == 4 || stride == 8
                                                                               : filter != "QUATERNION" || stride == 8;
  if (!stride_suits_mode || !stride_suits_filter)
    check.complain(path + ".byteStride", "does not suit the mode and the filter");
  if (mode == "TRIANGLES" && count % 3 != 0) check.complain(path + ".count", "must be a multiple of 3");
  if (!attributes && filter != "NONE") check.complain(path + ".filter", "is for attributes only");
  if (view.value("byteStride", stride) != stride) check.complain(path + ".byteStride", "differs from the view's");
  if (view["byteLength"].get<uint64_t>() != stride * count)
    check.complain(path, "byteStride times count is not the view's byteLength");
}

void check_view(JsonCheck& check, const json& view, const std::string& path, json&) {
  if (view.value("byteStride", 4u) % 4 != 0) check.complain(path + ".byteStride", "must be a multiple of 4");
  if (const auto packing = meshopt_packing(view))
    check_meshopt_layout(check, view, *packing->members, path + ".extensions." + packing->extension);
}

void check_component_type(JsonCheck& check, const json& object, const std::string& path, json&) {
  if (object["componentType"] == 5124) check.complain(path + ".componentType", "5124 is not a component type of glTF");
}

void check_accessor(JsonCheck& check, const json& accessor, const std::string& path, json& copy) {
  check_component_type(check, accessor, path, copy);
  if (!is_gltf_accessor_type(accessor["type"].get_ref<const std::string&>())) copy["type"] = "SCALAR";
}

constexpr Member kBuffer[] = {required(whole("byteLength", 1, kMaxOffset)), text("uri")};
constexpr Member kMeshoptPacking[] = {required(index("buffer", "buffers")),
                                      whole("byteOffset", 0, kMaxOffset),
                                      required(whole("byteLength", 1, kMaxOffset)),
                                      required(whole("byteStride", 2, 256)),
                                      required(whole("count", 1, kMaxInt)),
                                      required(word("mode", kMeshoptModes)),
                                      word("filter", kMeshoptFilters)};
constexpr Member kViewExtensions[] = {object(kMeshoptExtensions[0], kMeshoptPacking),
                                      object(kMeshoptExtensions[1], kMeshoptPacking)};
constexpr Member kView[] = {required(index("buffer", "buffers")), whole("byteOffset", 0, kMaxOffset),
                            required(whole("byteLength", 1, kMaxOffset)), whole("byteStride", 4, 252),
                            withheld(object("extensions", kViewExtensions))};
constexpr Member kComponentType = required(whole("componentType", 5120, 5126));
constexpr Member kSparseIndices[] = {required(index("bufferView", "bufferViews")), whole("byteOffset", 0, kMaxInt),
                                     kComponentType};
constexpr Member kSparseValues[] = {required(index("bufferView", "bufferViews")), whole("byteOffset", 0, kMaxInt)};
constexpr Member kSparse[] = {required(whole("count", 1, kMaxInt)),
                              required(object("indices", kSparseIndices, check_component_type)),
                              required(object("values", kSparseValues))};
constexpr Member kAccessor[] = {index("bufferView", "bufferViews"),
                                whole("byteOffset", 0, kMaxOffset),
                                kComponentType,
                                plain("normalized", Kind::kBoolean),
                                required(whole("count", 1, kMaxInt)),
                                required(text("type")),
                                object("sparse", kSparse)};

// --- meshes
// ------------------------------------------------------------------------------------------------------------

void check_primitive(JsonCheck& check, const json& primitive, const std::string& path, json& copy) {
  copy["attributes"].erase(kIndicesAttribute);
  if (primitive.contains("indices")) copy["attributes"][kIndicesAttribute] = primitive["indices"];
  if (!primitive.contains("extensions") || !primitive["extensions"].contains(kDracoExtension)) return;
  if (!primitive["extensions"][kDracoExtension]["attributes"].contains("POSITION"))
    check.complain(path + ".extensions." + kDracoExtension + ".attributes.POSITION", "is missing");
  if (const int mode = primitive.value("mode", 4); mode != 4 && mode != 5)
    check.complain(path + ".mode", "must be triangles or a triangle strip where Draco packs them");
}

constexpr Member kDracoPacking[] = {
    required(index("bufferView", "bufferViews")),
    required({.key = "attributes", .kind = Kind::kWholeByName, .low = 0, .high = kMaxInt})};
constexpr Member kPrimitiveExtensions[] = {object(kDracoExtension, kDracoPacking)};
constexpr Member kPrimitive[] = {required(accessors_by_name("attributes")),
                                 withheld(index("indices", "accessors")),
                                 index("material", "materials"),
                                 whole("mode", 0, 6),
                                 plain("targets", Kind::kArray),
                                 object("extensions", kPrimitiveExtensions)};
constexpr Member kMesh[] = {text("name"), required(objects("primitives", kPrimitive, check_primitive))};

constexpr Member kColour[] = {numbers("baseColorFactor", 4)};
constexpr Member kTransmission[] = {plain("transmissionFactor", Kind::kShare)};
constexpr Member kMaterialExtensions[] = {object("KHR_materials_transmission", kTransmission)};
constexpr Member kMaterial[] = {text("name"), text("alphaMode"), object("pbrMetallicRoughness", kColour),
                                object("extensions", kMaterialExtensions)};

// --- nodes and cameras
// -------------------------------------------------------------------------------------------------

void check_camera(JsonCheck& check, const json& camera, const std::string& path, json&) {
  const std::string type = camera["type"];
  if (type != "perspective" && type != "orthographic")
    check.complain(path + ".type", "must be perspective or orthographic");
  else if (!camera.contains(type))
    check.complain(in(path, type), "is missing");
}

// The part of a node's extras that Sightline reads. Other members are for the players of the scene.
constexpr Member kOurExtras[] = {whole("layers", 0, std::numeric_limits<uint32_t>::max()),
                                 plain("opacity", Kind::kShare), plain("occludes", Kind::kFlag),
                                 plain("collides", Kind::kFlag), plain("visible", Kind::kFlag)};
constexpr Member kExtras[] = {object("sightline", kOurExtras)};

void check_extras(JsonCheck& check, const json& node, const std::string& path, json&) {
  const auto extras = node.find("extras");
  if (extras != node.end() && extras->is_object()) check.walk(*extras, in(path, "extras"), kExtras, nullptr);
}

constexpr Member kInstancing[] = {required(accessors_by_name("attributes"))};
constexpr Member kVisibility[] = {plain("visible", Kind::kBoolean)};
constexpr Member kNodeExtensions[] = {object("EXT_mesh_gpu_instancing", kInstancing),
                                      object("KHR_node_visibility", kVisibility)};
constexpr Member kNode[] = {text("name"),
                            indices("children", "nodes"),
                            index("mesh", "meshes"),
                            index("camera", "cameras"),
                            index("skin", "skins"),
                            numbers("matrix", 16),
                            numbers("translation", 3),
                            numbers("rotation", 4),
                            numbers("scale", 3),
                            object("extensions", kNodeExtensions)};
constexpr Member kScene[] = {text("name"), indices("nodes", "nodes")};

constexpr Member kPerspective[] = {required(plain("yfov", Kind::kPositive)), plain("aspectRatio", Kind::kPositive),
                                   required(plain("znear", Kind::kPositive)), plain("zfar", Kind::kPositive)};
constexpr Member kOrthographic[] = {required(plain("xmag", Kind::kNumber)), required(plain("ymag", Kind::kNumber)),
                                    required(plain("znear", Kind::kNumber)), required(plain("zfar", Kind::kNumber))};
constexpr Member kCamera[] = {text("name"), required(text("type")), object("perspective", kPerspective),
                              object("orthographic", kOrthographic)};

// --- animations
// --------------------------------------------------------------------------------------------------------

// A channel without a target node belongs to an extension and is to be ignored (glTF 2.0 section 3.11).
void check_animation(JsonCheck& check, const json& animation, const std::string& path, json& copy) {
  const json& channels = animation["channels"];
  json played = json::array();
  for (size_t i = 0; i < channels.size(); ++i) {
    check.check_index(channels[i]["sampler"], at(in(path, "channels"), i) + ".sampler", "samplers",
                      animation["samplers"].size());
    if (channels[i]["target"].contains("node")) played.push_back(copy["channels"][i]);
  }
  copy["channels"] = std::move(played);
}

constexpr Member kSampler[] = {required(index("input", "accessors")), required(index("output", "accessors")),
                               text("interpolation")};
constexpr Member kTarget[] = {index("node", "nodes"), required(text("path"))};
constexpr Member kChannel[] = {required(whole("sampler", 0, kMaxInt)), required(object("target", kTarget))};
constexpr Member kAnimation[] = {text("name"), required(objects("samplers", kSampler)),
                                 required(objects("channels", kChannel))};

constexpr Member kSkin[] = {text("name"), required(indices("joints", "nodes")),
                            index("inverseBindMatrices", "accessors"), index("skeleton", "nodes")};

constexpr Member kBody[] = {withheld(objects("buffers", kBuffer)),
                            objects("bufferViews", kView, check_view),
                            objects("accessors", kAccessor, check_accessor),
                            objects("meshes", kMesh),
                            objects("nodes", kNode, check_extras),
                            index("scene", "scenes"),
                            objects("scenes", kScene),
                            objects("cameras", kCamera, check_camera),
                            objects("materials", kMaterial, nullptr, kMaxMaterials),
                            objects("animations", kAnimation, check_animation),
                            withheld(objects("skins", kSkin))};  // tinygltf refuses those without bind matrices

}  // namespace

bool is_gltf_accessor_type(std::string_view type) {
  return std::ranges::find(kAccessorTypes, type) != kAccessorTypes.end();
}

Result<json> check_gltf_json(const json& document, const GltfLimits& limits) {
  JsonCheck check(document, limits.work);
  json head = check.walk(document, "", kHead, check_required_extensions);
  if (const auto nodes = document.find("nodes"); nodes != document.end() && nodes->size() > limits.max_nodes)
    check.complain("nodes", "has more than " + std::to_string(limits.max_nodes) + " items",
                   ErrorCode::kResourceExhausted);
  json copy = check.walk(document, "", kBody, nullptr);
  if (check.failed()) return tl::unexpected(*check.error());
  copy["asset"] = std::move(head["asset"]);
  return copy;
}

}  // namespace sightline
