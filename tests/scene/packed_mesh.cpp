#include "tests/scene/packed_mesh.h"

#include <draco/compression/encode.h>
#include <meshoptimizer.h>

#include <cmath>

namespace sightline {
namespace {

unsigned char* bytes_of(std::vector<std::byte>& buffer) {
  return reinterpret_cast<unsigned char*>(buffer.data());
}

void to_draco(const MeshData& mesh, draco::Mesh& out) {
  out.set_num_points(static_cast<uint32_t>(mesh.positions.size()));
  draco::GeometryAttribute description;
  description.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false, sizeof(glm::vec3), 0);
  const int id = out.AddAttribute(description, true, out.num_points());
  for (uint32_t i = 0; i < out.num_points(); ++i)
    out.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), &mesh.positions[i]);
  for (size_t i = 0; i < mesh.indices.size(); i += 3)
    out.AddFace({draco::PointIndex(mesh.indices[i]), draco::PointIndex(mesh.indices[i + 1]),
                 draco::PointIndex(mesh.indices[i + 2])});
}

template <typename T>
void add_fours(const std::vector<T>& values, draco::DataType type, draco::Mesh& out) {
  draco::GeometryAttribute description;
  description.Init(draco::GeometryAttribute::GENERIC, nullptr, 4, type, false, 4 * sizeof(T), 0);
  const int id = out.AddAttribute(description, true, out.num_points());
  for (uint32_t i = 0; i < out.num_points(); ++i)
    out.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), &values[4 * size_t{i}]);
}

}  // namespace

MeshData hills(uint32_t n) {
  MeshData mesh;
  for (uint32_t j = 0; j <= n; ++j)
    for (uint32_t i = 0; i <= n; ++i) {
      const float x = static_cast<float>(i), z = static_cast<float>(j);
      mesh.positions.push_back({x, std::sin(0.7f * x) + 0.4f * std::cos(1.3f * z + 0.2f * x), 1.1f * z});
    }
  for (uint32_t j = 0; j < n; ++j)
    for (uint32_t i = 0; i < n; ++i) {
      const uint32_t a = j * (n + 1) + i, b = a + n + 1;
      mesh.indices.insert(mesh.indices.end(), {a, b, a + 1, a + 1, b, b + 1});
    }
  return mesh;
}

std::vector<std::byte> meshopt_attributes(std::span<const std::byte> elements, size_t stride) {
  const size_t count = elements.size() / stride;
  std::vector<std::byte> out(meshopt_encodeVertexBufferBound(count, stride));
  out.resize(meshopt_encodeVertexBuffer(bytes_of(out), out.size(), elements.data(), count, stride));
  return out;
}

std::vector<std::byte> meshopt_triangles(const std::vector<uint32_t>& indices, size_t vertex_count) {
  meshopt_encodeIndexVersion(1);
  std::vector<std::byte> out(meshopt_encodeIndexBufferBound(indices.size(), vertex_count));
  out.resize(meshopt_encodeIndexBuffer(bytes_of(out), out.size(), indices.data(), indices.size()));
  return out;
}

std::vector<std::byte> meshopt_sequence(const std::vector<uint32_t>& indices, size_t vertex_count) {
  meshopt_encodeIndexVersion(1);
  std::vector<std::byte> out(meshopt_encodeIndexSequenceBound(indices.size(), vertex_count));
  out.resize(meshopt_encodeIndexSequence(bytes_of(out), out.size(), indices.data(), indices.size()));
  return out;
}

std::vector<std::byte> draco_stream(const MeshData& mesh, const DracoOptions& options, const DracoSkin& skin) {
  draco::Encoder encoder;
  encoder.SetEncodingMethod(options.edgebreaker ? draco::MESH_EDGEBREAKER_ENCODING : draco::MESH_SEQUENTIAL_ENCODING);
  if (options.quantization_bits > 0)
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, options.quantization_bits);
  draco::Mesh source;
  to_draco(mesh, source);
  if (!skin.joints.empty()) add_fours(skin.joints, draco::DT_UINT16, source);
  if (!skin.weights.empty()) add_fours(skin.weights, draco::DT_FLOAT32, source);
  draco::EncoderBuffer buffer;
  if (!encoder.EncodeMeshToBuffer(source, &buffer).ok()) return {};
  const auto* first = reinterpret_cast<const std::byte*>(buffer.data());
  return {first, first + buffer.size()};
}

int PackedFile::packed_view(std::span<const std::byte> stream, size_t count, size_t stride, const char* mode,
                            const char* filter) {
  const int index = view(stream);
  nlohmann::json& item = json["bufferViews"][index];
  nlohmann::json description = item;
  description["count"] = count, description["byteStride"] = stride, description["mode"] = mode;
  if (filter) description["filter"] = filter;
  item = {{"buffer", 1}, {"byteOffset", unpacked_bytes_}, {"byteLength", count * stride}};
  if (std::string(mode) == "ATTRIBUTES" && stride <= 252) item["byteStride"] = stride;
  item["extensions"]["EXT_meshopt_compression"] = std::move(description);
  unpacked_bytes_ += (count * stride + 3) / 4 * 4;
  return index;
}

int PackedFile::meshopt_node(const MeshData& mesh, size_t index_bytes) {
  const std::vector<std::byte> positions = meshopt_attributes(std::as_bytes(std::span(mesh.positions)),
                                                              sizeof(glm::vec3));
  const std::vector<std::byte> indices = meshopt_triangles(mesh.indices, mesh.positions.size());
  const int position = accessor_over(packed_view(positions, mesh.positions.size(), sizeof(glm::vec3), "ATTRIBUTES"),
                                     mesh.positions.size(), "VEC3", kFloat);
  const int index = accessor_over(packed_view(indices, mesh.indices.size(), index_bytes, "TRIANGLES"),
                                  mesh.indices.size(), "SCALAR", index_bytes == 2 ? kUnsignedShort : kUnsignedInt);
  return mesh_node({{"attributes", {{"POSITION", position}}}, {"indices", index}});
}

int PackedFile::draco_node(const MeshData& mesh, const DracoOptions& options, const DracoSkin& skin) {
  const int packed = view(draco_stream(mesh, options, skin));
  const int position = accessor_over(-1, mesh.positions.size(), "VEC3", kFloat);
  const int index = accessor_over(-1, mesh.indices.size(), "SCALAR", kUnsignedInt);
  nlohmann::json extension = {{"bufferView", packed}, {"attributes", {{"POSITION", 0}}}};
  nlohmann::json attributes = {{"POSITION", position}};
  if (!skin.joints.empty()) {
    extension["attributes"].update({{"JOINTS_0", 1}, {"WEIGHTS_0", 2}});
    attributes["JOINTS_0"] = accessor_over(-1, mesh.positions.size(), "VEC4", kUnsignedShort);
    attributes["WEIGHTS_0"] = accessor_over(-1, mesh.positions.size(), "VEC4", kFloat);
  }
  return mesh_node({{"attributes", std::move(attributes)},
                    {"indices", index},
                    {"extensions", {{"KHR_draco_mesh_compression", extension}}}});
}

std::vector<std::byte> PackedFile::packed_glb() {
  json["buffers"] = nlohmann::json::array({{{"byteLength", binary().size()}}});
  if (unpacked_bytes_ > 0) json["buffers"].push_back({{"byteLength", unpacked_bytes_}});
  json["extensionsUsed"] = {"EXT_meshopt_compression", "KHR_draco_mesh_compression", "KHR_mesh_quantization"};
  json["extensionsRequired"] = json["extensionsUsed"];
  return glb();
}

}  // namespace sightline
