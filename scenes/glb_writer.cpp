#include "scenes/glb_writer.h"

#include <algorithm>
#include <cassert>
#include <cstring>

namespace sightline::scenes {
namespace {

using Json = nlohmann::ordered_json;

// Numbers of the format (glTF 2.0, 5.1 and 5.11).
constexpr int kUnsignedShort = 5123;
constexpr int kUnsignedInt = 5125;
constexpr int kFloat = 5126;
constexpr int kArrayBuffer = 34962;
constexpr int kElementArrayBuffer = 34963;
constexpr int kNoTarget = 0;

void pad_to_four(std::vector<std::byte>& bytes, char filler) {
  while (bytes.size() % 4 != 0) bytes.push_back(static_cast<std::byte>(filler));
}

void append_u32(std::vector<std::byte>& bytes, size_t value) {
  for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::byte>(value >> shift));
}

void append_chunk(std::vector<std::byte>& file, const char* kind, std::span<const std::byte> payload) {
  append_u32(file, payload.size());
  for (int i = 0; i < 4; ++i) file.push_back(static_cast<std::byte>(kind[i]));
  file.insert(file.end(), payload.begin(), payload.end());
}

Json to_json(const glm::dvec3& v) {
  return {v.x, v.y, v.z};
}

}  // namespace

int GlbWriter::add_view(std::span<const std::byte> bytes, int target) {
  pad_to_four(binary_, 0);
  Json view{{"buffer", 0}, {"byteOffset", binary_.size()}, {"byteLength", bytes.size()}};
  if (target != kNoTarget) view["target"] = target;
  views_.push_back(std::move(view));
  binary_.insert(binary_.end(), bytes.begin(), bytes.end());
  return static_cast<int>(views_.size()) - 1;
}

int GlbWriter::add_accessor(std::span<const std::byte> bytes, int target, int component_type, const char* type,
                            size_t count) {
  accessors_.push_back(
      {{"bufferView", add_view(bytes, target)}, {"componentType", component_type}, {"count", count}, {"type", type}});
  return static_cast<int>(accessors_.size()) - 1;
}

int GlbWriter::add_indices(const std::vector<uint32_t>& indices, size_t vertex_count) {
  if (vertex_count > 65535)
    return add_accessor(std::as_bytes(std::span(indices)), kElementArrayBuffer, kUnsignedInt, "SCALAR", indices.size());
  const std::vector<uint16_t> narrow(indices.begin(), indices.end());
  return add_accessor(std::as_bytes(std::span(narrow)), kElementArrayBuffer, kUnsignedShort, "SCALAR", narrow.size());
}

int GlbWriter::add_material(const glm::vec3& color) {
  const Json factor{color.r, color.g, color.b, 1.0f};
  for (size_t i = 0; i < materials_.size(); ++i)
    if (materials_[i]["pbrMetallicRoughness"]["baseColorFactor"] == factor) return static_cast<int>(i);
  materials_.push_back({{"pbrMetallicRoughness", {{"baseColorFactor", factor}, {"metallicFactor", 0.0}}}});
  return static_cast<int>(materials_.size()) - 1;
}

int GlbWriter::add_mesh(const std::string& name, const MeshData& mesh, const glm::vec3& color) {
  assert(!mesh.indices.empty());
  Aabb bounds;
  for (const glm::vec3& p : mesh.positions) bounds.grow(p);
  const int positions = add_accessor(std::as_bytes(std::span(mesh.positions)), kArrayBuffer, kFloat, "VEC3",
                                     mesh.positions.size());
  accessors_.back()["min"] = to_json(bounds.min);
  accessors_.back()["max"] = to_json(bounds.max);
  const int indices = add_indices(mesh.indices, mesh.positions.size());
  const Json primitive{
      {"attributes", {{"POSITION", positions}}}, {"indices", indices}, {"material", add_material(color)}};
  meshes_.push_back({{"name", name}, {"primitives", Json::array({primitive})}});
  return static_cast<int>(meshes_.size()) - 1;
}

int GlbWriter::add_camera(double vertical_fov_rad, double aspect, double near_m) {
  cameras_.push_back({{"type", "perspective"},
                      {"perspective", {{"aspectRatio", aspect}, {"yfov", vertical_fov_rad}, {"znear", near_m}}}});
  return static_cast<int>(cameras_.size()) - 1;
}

int GlbWriter::add_node(const GlbNode& node) {
  const int index = static_cast<int>(nodes_.size());
  assert(node.parent < index);
  Json json{{"name", node.name}, {"translation", to_json(node.translation_m)}};
  if (node.rotation != glm::dquat(1, 0, 0, 0))
    json["rotation"] = {node.rotation.x, node.rotation.y, node.rotation.z, node.rotation.w};
  if (node.mesh >= 0) json["mesh"] = node.mesh;
  if (node.camera >= 0) json["camera"] = node.camera;
  if (!node.extras.is_null()) json["extras"] = node.extras;
  nodes_.push_back(std::move(json));
  if (node.parent < 0)
    roots_.push_back(index);
  else
    nodes_[static_cast<size_t>(node.parent)]["children"].push_back(index);
  return index;
}

int GlbWriter::add_times(std::span<const float> times_s) {
  if (last_times_ >= 0 && std::equal(times_s.begin(), times_s.end(), last_times_s_.begin(), last_times_s_.end()))
    return last_times_;
  last_times_s_.assign(times_s.begin(), times_s.end());
  last_times_ = add_accessor(std::as_bytes(times_s), kNoTarget, kFloat, "SCALAR", times_s.size());
  accessors_.back()["min"] = {times_s.front()};
  accessors_.back()["max"] = {times_s.back()};
  return last_times_;
}

void GlbWriter::animate(int node, std::span<const float> times_s, std::span<const glm::vec3> translations_m,
                        std::span<const glm::quat> rotations) {
  assert(!times_s.empty() && times_s.size() == translations_m.size() && times_s.size() == rotations.size());
  std::vector<glm::vec4> xyzw;  // glm may keep w first
  for (const glm::quat& q : rotations) xyzw.emplace_back(q.x, q.y, q.z, q.w);
  const int input = add_times(times_s);
  const int translation = add_accessor(std::as_bytes(translations_m), kNoTarget, kFloat, "VEC3", translations_m.size());
  const int rotation = add_accessor(std::as_bytes(std::span(xyzw)), kNoTarget, kFloat, "VEC4", xyzw.size());
  const auto add_channel = [&](int output, const char* path) {
    channels_.push_back({{"sampler", samplers_.size()}, {"target", {{"node", node}, {"path", path}}}});
    samplers_.push_back({{"input", input}, {"output", output}, {"interpolation", "LINEAR"}});
  };
  add_channel(translation, "translation");
  add_channel(rotation, "rotation");
}

std::vector<std::byte> GlbWriter::finish(const std::string& animation_name) const {
  Json document{{"asset", {{"version", "2.0"}, {"generator", "make-scenes"}}},
                {"scene", 0},
                {"scenes", Json::array({{{"nodes", roots_}}})},
                {"nodes", nodes_}};
  const auto add = [&](const char* key, const Json& array) {
    if (!array.empty()) document[key] = array;
  };
  add("meshes", meshes_);
  add("materials", materials_);
  add("cameras", cameras_);
  if (!channels_.empty())
    document["animations"] = Json::array(
        {{{"name", animation_name}, {"channels", channels_}, {"samplers", samplers_}}});
  add("accessors", accessors_);
  add("bufferViews", views_);
  std::vector<std::byte> binary = binary_;
  pad_to_four(binary, 0);
  if (!binary.empty()) document["buffers"] = Json::array({{{"byteLength", binary.size()}}});

  const std::string text = document.dump();
  std::vector<std::byte> json(text.size());
  std::memcpy(json.data(), text.data(), text.size());
  pad_to_four(json, ' ');
  std::vector<std::byte> file;
  append_u32(file, 0x46546C67);  // "glTF"
  append_u32(file, 2);
  append_u32(file, 12 + 8 + json.size() + (binary.empty() ? 0 : 8 + binary.size()));
  append_chunk(file, "JSON", json);
  if (!binary.empty()) append_chunk(file, "BIN\0", binary);
  return file;
}

}  // namespace sightline::scenes
