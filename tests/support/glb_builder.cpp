#include "tests/support/glb_builder.h"

#include <algorithm>
#include <cstdint>

namespace sightline {
namespace {

using nlohmann::json;

void append_u32(std::vector<std::byte>& out, uint32_t value) {
  out.resize(out.size() + sizeof value);
  std::memcpy(out.data() + out.size() - sizeof value, &value, sizeof value);
}

void append_chunk(std::vector<std::byte>& out, uint32_t type, std::span<const std::byte> data) {
  append_u32(out, static_cast<uint32_t>(data.size()));
  append_u32(out, type);
  out.insert(out.end(), data.begin(), data.end());
}

std::string base64(std::span<const std::byte> bytes) {
  static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t group = 0;
    for (size_t k = 0; k < 3; ++k)
      group = group << 8 | (i + k < bytes.size() ? std::to_integer<uint32_t>(bytes[i + k]) : 0);
    const size_t digits = std::min<size_t>(bytes.size() - i, 3) + 1;
    for (size_t k = 0; k < 4; ++k) text.push_back(k < digits ? kDigits[group >> (18 - 6 * k) & 63] : '=');
  }
  return text;
}

}  // namespace

GlbBuilder::GlbBuilder() {
  json["asset"]["version"] = "2.0";
}

int GlbBuilder::view(std::span<const std::byte> bytes, int stride) {
  while (binary_.size() % 4 != 0) binary_.push_back(std::byte{0});
  nlohmann::json item = {{"buffer", 0}, {"byteOffset", binary_.size()}, {"byteLength", bytes.size()}};
  if (stride > 0) item["byteStride"] = stride;
  binary_.insert(binary_.end(), bytes.begin(), bytes.end());
  return add("bufferViews", item);
}

int GlbBuilder::accessor_over(int buffer_view, size_t count, const char* type, ComponentType component,
                              bool normalized) {
  nlohmann::json item = {{"count", count}, {"type", type}, {"componentType", static_cast<int>(component)}};
  if (buffer_view >= 0) item["bufferView"] = buffer_view;
  if (normalized) item["normalized"] = true;
  return add("accessors", item);
}

int GlbBuilder::add(const char* collection, nlohmann::json item) {
  json[collection].push_back(std::move(item));
  return static_cast<int>(json[collection].size()) - 1;
}

int GlbBuilder::mesh_node(nlohmann::json primitive) {
  const int mesh = add("meshes", {{"primitives", nlohmann::json::array({std::move(primitive)})}});
  return add("nodes", {{"mesh", mesh}});
}

int GlbBuilder::triangle_node() {
  return mesh_node({{"attributes", {{"POSITION", floats({0, 0, 0, 1, 0, 0, 0, 1, 0})}}}});
}

int GlbBuilder::animation(int node, const char* path, const char* interpolation, const std::vector<float>& times,
                          const std::vector<float>& values) {
  const int input = floats(times, "SCALAR");
  const int output = floats(values, std::string(path) == "rotation" ? "VEC4" : "VEC3");
  nlohmann::json sampler = {{"input", input}, {"output", output}, {"interpolation", interpolation}};
  nlohmann::json channel = {{"sampler", 0}, {"target", {{"node", node}, {"path", path}}}};
  return add("animations",
             {{"samplers", nlohmann::json::array({sampler})}, {"channels", nlohmann::json::array({channel})}});
}

size_t GlbBuilder::components_of(const char* type) {
  const std::string name(type);
  if (name == "SCALAR") return 1;
  const auto side = static_cast<size_t>(type[3] - '0');
  return name.starts_with("MAT") ? side * side : side;
}

// A test that sets buffers[0] itself is left alone.
nlohmann::json GlbBuilder::finished(const std::string* uri) const {
  nlohmann::json out = json;
  if (binary_.empty() && !uri) return out;
  if (!out.contains("buffers")) out["buffers"].push_back({{"byteLength", binary_.size()}});
  if (uri) out["buffers"][0]["uri"] = *uri;
  return out;
}

std::vector<std::byte> GlbBuilder::glb() const {
  return make_glb(finished(nullptr).dump(), binary_);
}

std::vector<std::byte> GlbBuilder::gltf(const std::string& buffer_uri) const {
  return bytes_of(finished(&buffer_uri).dump());
}

std::vector<std::byte> GlbBuilder::gltf_with_data_uri() const {
  return gltf("data:application/octet-stream;base64," + base64(binary_));
}

std::vector<std::byte> make_glb(std::string json_text, std::vector<std::byte> binary) {
  while (json_text.size() % 4 != 0) json_text.push_back(' ');
  while (binary.size() % 4 != 0) binary.push_back(std::byte{0});
  std::vector<std::byte> out;
  append_u32(out, 0x46546C67);
  append_u32(out, 2);
  append_u32(out, 0);
  append_chunk(out, 0x4E4F534A, std::as_bytes(std::span(json_text)));
  if (!binary.empty()) append_chunk(out, 0x004E4942, binary);
  const auto length = static_cast<uint32_t>(out.size());
  std::memcpy(out.data() + 8, &length, sizeof length);
  return out;
}

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

}  // namespace sightline
