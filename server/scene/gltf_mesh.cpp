// Primitives to triangles (glTF 2.0 section 3.7.2). All primitives of a mesh become one geometry, the
// occluding ones first; only vertices that a triangle uses are kept.
#include <array>
#include <cmath>
#include <numeric>

#include "server/scene/gltf_accessor.h"
#include "server/scene/gltf_document.h"
#include "server/scene/gltf_json.h"

namespace sightline {
namespace {

constexpr float kMaxCoordinate =
    1e9f;  // metres; further out single precision is useless, and squares overflow

// The accessor of an attribute, -1 when absent.
int accessor_of(const tinygltf::Primitive& primitive, const char* attribute) {
  const auto it = primitive.attributes.find(attribute);
  return it == primitive.attributes.end() ? -1 : it->second;
}

struct Triangles {
  std::vector<glm::vec3> positions;
  std::vector<uint32_t> indices;
};

bool is_see_through(const tinygltf::Model& model, const tinygltf::Primitive& primitive) {
  if (primitive.material < 0) return false;
  const tinygltf::Material& material = model.materials[static_cast<size_t>(primitive.material)];
  return material.alphaMode == "BLEND" &&
         material.pbrMetallicRoughness.baseColorFactor[3] < kOccludingOpacity;
}

// How many triangles `count` vertices make; an Error when the count does not suit the mode.
Result<size_t> triangles_of(int mode, size_t count, const std::string& field) {
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    if (count % 3 != 0)
      return invalid(field, "triangles need a multiple of 3 vertices, got " + std::to_string(count));
    return count / 3;
  }
  if (count < 3) return invalid(field, "a strip or fan needs 3 vertices, got " + std::to_string(count));
  return count - 2;
}

// Corners of triangle `t` as places in the vertex sequence, counter-clockwise as the specification orders
// them.
std::array<size_t, 3> corners(int mode, size_t t) {
  if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) return {t, t + 1 + t % 2, t + 2 - t % 2};
  if (mode == TINYGLTF_MODE_TRIANGLE_FAN) return {t + 1, t + 2, 0};
  return {3 * t, 3 * t + 1, 3 * t + 2};
}

Result<std::vector<glm::vec3>> read_positions(const GltfDocument& document, int accessor,
                                              const std::string& field) {
  const auto flat = read_gltf_floats(document, accessor, 3, GltfComponents::kFloatOrAnyInteger, field);
  if (!flat) return tl::unexpected(flat.error());
  std::vector<glm::vec3> positions(flat->size() / 3);
  for (size_t i = 0; i < positions.size(); ++i) {
    positions[i] = {(*flat)[3 * i], (*flat)[3 * i + 1], (*flat)[3 * i + 2]};
    for (int axis = 0; axis < 3; ++axis)
      if (!(std::abs(positions[i][axis]) <= kMaxCoordinate))
        return invalid(gltf_path(field.c_str(), i), "must be finite and within 1e9 m");
  }
  return positions;
}

// The vertex sequence that the mode runs over: the index accessor, or 0, 1, 2 ...
Result<std::vector<uint32_t>> read_sequence(const GltfDocument& document, int accessor, size_t vertex_count,
                                            const std::string& field) {
  if (accessor < 0) {
    std::vector<uint32_t> sequence(vertex_count);
    std::iota(sequence.begin(), sequence.end(), 0u);
    return sequence;
  }
  auto indices = read_gltf_indices(document, accessor, field);
  if (!indices) return indices;
  for (size_t i = 0; i < indices->size(); ++i)
    if ((*indices)[i] >= vertex_count)
      return invalid(gltf_path(field.c_str(), i), "is " + std::to_string((*indices)[i]) + ", there are " +
                                                      std::to_string(vertex_count) + " vertices");
  return indices;
}

// Appends the triangles, copying each used vertex once, in its original order.
void append(const std::vector<glm::vec3>& positions, const std::vector<uint32_t>& sequence, int mode,
            size_t triangle_count, Triangles& out) {
  constexpr uint32_t kUnused = UINT32_MAX;
  std::vector<uint32_t> place(positions.size(), kUnused);
  for (const uint32_t vertex : sequence) place[vertex] = 0;
  for (size_t vertex = 0; vertex < positions.size(); ++vertex) {
    if (place[vertex] == kUnused) continue;
    place[vertex] = static_cast<uint32_t>(out.positions.size());
    out.positions.push_back(positions[vertex]);
  }
  for (size_t t = 0; t < triangle_count; ++t)
    for (const size_t corner : corners(mode, t)) out.indices.push_back(place[sequence[corner]]);
}

// What the limits say before any of the primitive's data is read: the number of its triangles.
Result<size_t> plan_primitive(GltfDocument& document, int mode, int position, int indices,
                              const std::string& field) {
  const auto& accessors = document.model.accessors;
  const size_t vertices = accessors[static_cast<size_t>(position)].count;
  const size_t length = indices >= 0 ? accessors[static_cast<size_t>(indices)].count : vertices;
  const auto triangles =
      triangles_of(mode, length, field + (indices >= 0 ? ".indices" : ".attributes.POSITION"));
  if (!triangles) return triangles;
  if (const Status s = GltfBudget::take(document.budget.triangles, *triangles, field, "triangles"); !s)
    return tl::unexpected(s.error());
  if (const Status s = GltfBudget::take(document.budget.vertices, vertices, field, "vertices"); !s)
    return tl::unexpected(s.error());
  return triangles;
}

Status read_triangles(GltfDocument& document, int mode, int position, int indices, const std::string& field,
                      Triangles& out) {
  const auto triangle_count = plan_primitive(document, mode, position, indices, field);
  if (!triangle_count) return tl::unexpected(triangle_count.error());
  const auto positions = read_positions(document, position, field + ".attributes.POSITION");
  if (!positions) return tl::unexpected(positions.error());
  const auto sequence = read_sequence(document, indices, positions->size(), field + ".indices");
  if (!sequence) return tl::unexpected(sequence.error());
  append(*positions, *sequence, mode, *triangle_count, out);
  return {};
}

Status read_primitive(GltfDocument& document, const tinygltf::Primitive& primitive, const std::string& field,
                      Triangles& out) {
  const int position = accessor_of(primitive, "POSITION");
  if (primitive.mode < TINYGLTF_MODE_TRIANGLES) {
    document.warnings.add(field + ": points and lines are skipped");
    return {};
  }
  if (position < 0) {
    document.warnings.add(field + ": has no POSITION and is skipped");
    return {};
  }
  if (!primitive.targets.empty()) document.warnings.add(field + ".targets: morph targets are drawn at rest");
  return read_triangles(document, primitive.mode, position, accessor_of(primitive, kIndicesAttribute), field,
                        out);
}

MeshData join(Triangles occluding, const Triangles& see_through) {
  const auto first_vertex = static_cast<uint32_t>(occluding.positions.size());
  MeshData mesh{std::move(occluding.positions), std::move(occluding.indices)};
  if (see_through.indices.empty()) return mesh;
  mesh.see_through_first_index = static_cast<uint32_t>(mesh.indices.size());
  mesh.positions.insert(mesh.positions.end(), see_through.positions.begin(), see_through.positions.end());
  for (const uint32_t index : see_through.indices) mesh.indices.push_back(first_vertex + index);
  return mesh;
}

Result<std::shared_ptr<const Geometry>> read_mesh(GltfDocument& document, const tinygltf::Mesh& mesh,
                                                  const std::string& field, GeometryStore& store) {
  Triangles occluding, see_through;
  for (size_t i = 0; i < mesh.primitives.size(); ++i) {
    Triangles& out = is_see_through(document.model, mesh.primitives[i]) ? see_through : occluding;
    const Status status =
        read_primitive(document, mesh.primitives[i], field + "." + gltf_path("primitives", i), out);
    if (!status) return tl::unexpected(status.error());
  }
  if (occluding.indices.empty() && see_through.indices.empty()) return nullptr;
  auto geometry = store.intern(join(std::move(occluding), see_through));
  if (!geometry) {
    geometry.error().field = field + "." + geometry.error().field;
    return geometry;
  }
  if ((*geometry)->triangle_count() == 0) return nullptr;  // all of them degenerate
  return geometry;
}

}  // namespace

Status read_gltf_meshes(GltfDocument& document, GeometryStore& store, SceneAsset& asset) {
  const auto& meshes = document.model.meshes;
  for (size_t i = 0; i < meshes.size(); ++i) {
    auto geometry = read_mesh(document, meshes[i], gltf_path("meshes", i), store);
    if (!geometry) return tl::unexpected(std::move(geometry.error()));
    asset.meshes.push_back(std::move(*geometry));
    asset.mesh_names.push_back(meshes[i].name);
  }
  return {};
}

}  // namespace sightline
