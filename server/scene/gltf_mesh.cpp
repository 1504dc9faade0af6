// Converts primitives to triangles (glTF 2.0 section 3.7.2). All primitives of a mesh become one geometry, the
// occluding ones first; only vertices that a triangle uses are kept.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "server/base/parallel.h"
#include "server/scene/gltf_accessor.h"
#include "server/scene/gltf_document.h"
#include "server/scene/gltf_draco.h"
#include "server/scene/gltf_json.h"
#include "server/scene/gltf_skin.h"

namespace sightline {
namespace {

// The accessor of an attribute, -1 when absent.
int accessor_of(const tinygltf::Primitive& primitive, const char* attribute) {
  const auto it = primitive.attributes.find(attribute);
  return it == primitive.attributes.end() ? -1 : it->second;
}

struct Triangles {
  std::vector<glm::vec3> positions;
  std::vector<uint32_t> indices;
};

bool is_see_through(const tinygltf::Material& material) {
  const auto transmission = material.extensions.find("KHR_materials_transmission");
  if (transmission != material.extensions.end() && transmission->second.Has("transmissionFactor") &&
      1.0 - transmission->second.Get("transmissionFactor").GetNumberAsDouble() < static_cast<double>(kOccludingOpacity))
    return true;
  return material.alphaMode == "BLEND" && material.pbrMetallicRoughness.baseColorFactor[3] < kOccludingOpacity;
}

// Whether a material is double-sided changes no answer of the daemon, so a wrong value counts as the default.
void read_materials(const GltfDocument& document, SceneAsset& asset) {
  for (size_t i = 0; i < document.model.materials.size(); ++i) {
    const nlohmann::json& json = document.json["materials"][i];
    const auto sides = json.find("doubleSided");
    const tinygltf::Material& material = document.model.materials[i];
    asset.materials.push_back({material.name, is_see_through(material), sides != json.end() && *sides == true});
  }
}

// A primitive without a material has glTF's default one, which is drawn from the front alone.
bool is_double_sided(const tinygltf::Mesh& mesh, const SceneAsset& asset) {
  return std::ranges::all_of(mesh.primitives, [&](const tinygltf::Primitive& primitive) {
    return primitive.material >= 0 && asset.materials[static_cast<size_t>(primitive.material)].double_sided;
  });
}

// What only a texture makes transparent is not known: textures are not read.
void warn_of_masks(GltfDocument& document) {
  for (size_t i = 0; i < document.model.materials.size(); ++i)
    if (document.model.materials[i].alphaMode == "MASK")
      document.warnings.add(
          gltf_path("materials", i) +
          ".alphaMode: what a texture masks hides as if it were solid; switch `occludes` off where that matters");
}

// How many triangles `count` vertices make. An incomplete one is left out with a warning.
size_t triangles_of(int mode, size_t count, const std::string& field, GltfWarnings& warnings) {
  const bool separate = mode == TINYGLTF_MODE_TRIANGLES;
  if (separate ? count % 3 != 0 : count < 3)
    warnings.add(field + ": " + std::to_string(count) +
                 " vertices do not make whole triangles; the incomplete one is left out");
  return separate ? count / 3 : count < 3 ? 0 : count - 2;
}

// Positions of the corners of triangle `t` in the vertex sequence, in the counter-clockwise order of the specification.
std::array<size_t, 3> corners(int mode, size_t t) {
  if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) return {t, t + 1 + t % 2, t + 2 - t % 2};
  if (mode == TINYGLTF_MODE_TRIANGLE_FAN) return {t + 1, t + 2, 0};
  return {3 * t, 3 * t + 1, 3 * t + 2};
}

Status check_positions(const std::vector<glm::vec3>& positions, const std::string& field) {
  for (size_t i = 0; i < positions.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      if (!(std::abs(positions[i][axis]) <= kMaxCoordinateM))
        return invalid(gltf_path(field.c_str(), i), "must be finite and within 1e9 m");
  return {};
}

Status check_sequence(const std::vector<uint32_t>& sequence, size_t vertex_count, const std::string& field) {
  for (size_t i = 0; i < sequence.size(); ++i)
    if (sequence[i] >= vertex_count)
      return invalid(gltf_path(field.c_str(), i),
                     "is " + std::to_string(sequence[i]) + ", there are " + std::to_string(vertex_count) + " vertices");
  return {};
}

// The vertex sequence that the mode runs over: the index accessor, or 0, 1, 2 ...
Result<std::vector<uint32_t>> read_sequence(GltfDocument& document, int accessor, size_t vertex_count,
                                            const std::string& field) {
  if (accessor >= 0) return read_gltf_indices(document, accessor, field);
  std::vector<uint32_t> sequence(vertex_count);
  std::iota(sequence.begin(), sequence.end(), 0u);
  return sequence;
}

// A primitive's vertices and the order in which its triangles run over them.
struct Corners {
  int mode = TINYGLTF_MODE_TRIANGLES;
  size_t triangle_count = 0;
  std::vector<glm::vec3> positions;
  std::vector<uint32_t> sequence;
  std::vector<GltfInfluences> influences = {};  // where they are packed with the mesh
};

// Appends the triangles, copying each used vertex once, in its original order.
void append(Corners from, Triangles& out) {
  constexpr uint32_t kUnused = UINT32_MAX;
  std::vector<uint32_t> place(from.positions.size(), kUnused);
  for (const uint32_t vertex : from.sequence) place[vertex] = 0;
  for (size_t vertex = 0; vertex < from.positions.size(); ++vertex) {
    if (place[vertex] == kUnused) continue;
    place[vertex] = static_cast<uint32_t>(out.positions.size());
    out.positions.push_back(from.positions[vertex]);
  }
  for (size_t t = 0; t < from.triangle_count; ++t)
    for (const size_t corner : corners(from.mode, t)) out.indices.push_back(place[from.sequence[corner]]);
}

// Applies the limits before any of the primitive's data is read. Returns the number of its triangles.
Result<size_t> plan_primitive(GltfDocument& document, int mode, int position, int indices, const std::string& field) {
  const auto& accessors = document.model.accessors;
  const size_t vertices = accessors[static_cast<size_t>(position)].count;
  const size_t length = indices >= 0 ? accessors[static_cast<size_t>(indices)].count : vertices;
  const size_t triangles = triangles_of(mode, length, field + (indices >= 0 ? ".indices" : ".attributes.POSITION"),
                                        document.warnings);
  if (const Status s = GltfBudget::take(document.budget.triangles, triangles, field, "triangles"); !s)
    return tl::unexpected(s.error());
  if (const Status s = GltfBudget::take(document.budget.vertices, vertices, field, "vertices"); !s)
    return tl::unexpected(s.error());
  return triangles;
}

Status read_accessors(GltfDocument& document, int position, int indices, const std::string& field, Corners& out) {
  auto positions = read_gltf_positions(document, position, field + ".attributes.POSITION");
  if (!positions) return tl::unexpected(std::move(positions.error()));
  auto sequence = read_sequence(document, indices, positions->size(), field + ".indices");
  if (!sequence) return tl::unexpected(std::move(sequence.error()));
  if (out.mode == TINYGLTF_MODE_TRIANGLES) sequence->resize(3 * out.triangle_count);
  out.positions = std::move(*positions);
  out.sequence = std::move(*sequence);
  return {};
}

Status read_draco(GltfDocument& document, const tinygltf::Value& packing, int position, bool skinned,
                  const std::string& field, Corners& out) {
  auto unpacked = unpack_draco(document, packing, position, skinned, out.triangle_count, field);
  if (!unpacked) return tl::unexpected(std::move(unpacked.error()));
  auto positions = read_gltf_positions(document, position, unpacked->positions, field + ".attributes.POSITION");
  if (!positions) return tl::unexpected(std::move(positions.error()));
  out.mode = TINYGLTF_MODE_TRIANGLES;
  out.triangle_count = unpacked->indices.size() / 3;
  out.positions = std::move(*positions);
  out.sequence = std::move(unpacked->indices);
  out.influences = std::move(unpacked->influences);
  return {};
}

Status read_triangles(GltfDocument& document, const tinygltf::Primitive& primitive, int position, const GltfSkin* skin,
                      const std::string& field, Triangles& out) {
  const int indices = accessor_of(primitive, kIndicesAttribute);
  const auto planned = plan_primitive(document, primitive.mode, position, indices, field);
  if (!planned) return tl::unexpected(planned.error());
  if (*planned == 0) return {};
  Corners corners{primitive.mode, *planned, {}, {}};
  const tinygltf::Value* packing = draco_packing(primitive);
  const Status read = packing ? read_draco(document, *packing, position, skin != nullptr, field, corners)
                              : read_accessors(document, position, indices, field, corners);
  if (!read) return read;
  if (skin) {
    const auto set_of = [&](size_t set) -> Result<std::optional<GltfInfluences>> {
      if (!packing) return read_gltf_influences(document, primitive, set, corners.positions.size(), field);
      if (set < corners.influences.size()) return std::move(corners.influences[set]);
      return std::nullopt;
    };
    if (const Status s = apply_gltf_skin(document, *skin, set_of, field, corners.positions); !s) return s;
  }
  if (const Status s = check_positions(corners.positions, field + ".attributes.POSITION"); !s) return s;
  if (const Status s = check_sequence(corners.sequence, corners.positions.size(), field + ".indices"); !s) return s;
  append(std::move(corners), out);
  return {};
}

Status read_primitive(GltfDocument& document, const tinygltf::Primitive& primitive, const GltfSkin* skin,
                      const std::string& field, Triangles& out) {
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
  return read_triangles(document, primitive, position, skin, field, out);
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

// Joins all primitives; the result has no indices when none of them has triangles.
Result<MeshData> read_mesh(GltfDocument& document, const SceneAsset& asset, const tinygltf::Mesh& mesh,
                           const GltfSkin* skin, const std::string& field) {
  Triangles occluding, see_through;
  for (size_t i = 0; i < mesh.primitives.size(); ++i) {
    if (document.work.ends(256)) return tl::unexpected(document.work.limit()->error());
    const int material = mesh.primitives[i].material;
    const bool hides = material < 0 || !asset.materials[static_cast<size_t>(material)].see_through;
    Triangles& out = hides ? occluding : see_through;
    const Status status = read_primitive(document, mesh.primitives[i], skin, field + "." + gltf_path("primitives", i),
                                         out);
    if (!status) return tl::unexpected(status.error());
  }
  return join(std::move(occluding), see_through);
}

// Null when all triangles are degenerate, or there are none.
Result<std::shared_ptr<const Geometry>> build_mesh(MeshData mesh, const std::string& field, GeometryStore& store,
                                                   WorkLimit* work) {
  if (mesh.indices.empty()) return nullptr;
  auto geometry = store.intern(std::move(mesh), work);
  if (!geometry && work && work->ended()) return geometry;
  if (!geometry)
    geometry.error().field = field + "." + geometry.error().field;
  else if ((*geometry)->triangle_count() == 0)
    return nullptr;
  return geometry;
}

// Meshes as they are read: those of the file, and one for each node with a skin.
struct ReadMesh {
  MeshData data;
  std::string field;
};

// A mesh that only nodes with a skin have is not drawn without one.
std::vector<bool> meshes_without_skin(const tinygltf::Model& model) {
  std::vector<bool> skinned(model.meshes.size(), false), plain(model.meshes.size(), false);
  for (const tinygltf::Node& node : model.nodes)
    if (node.mesh >= 0) (node.skin >= 0 ? skinned : plain)[static_cast<size_t>(node.mesh)] = true;
  for (size_t i = 0; i < plain.size(); ++i) plain[i] = plain[i] || !skinned[i];
  return plain;
}

Status read_skinned(GltfDocument& document, const std::vector<int>& asset_node_of, SceneAsset& asset,
                    std::vector<ReadMesh>& read) {
  const std::vector<Affine> world_from_node = rest_world_from_node(asset);
  for (size_t i = 0; i < document.model.nodes.size(); ++i) {
    const tinygltf::Node& node = document.model.nodes[i];
    if (asset_node_of[i] < 0 || node.mesh < 0 || node.skin < 0) continue;
    if (document.work.ends(256)) return tl::unexpected(document.work.limit()->error());
    const std::string field = gltf_path("nodes", i);
    const auto skin = read_gltf_skin(document, i, asset_node_of, world_from_node, field);
    if (!skin) return tl::unexpected(skin.error());
    const auto mesh = static_cast<size_t>(node.mesh);
    auto data = read_mesh(document, asset, document.model.meshes[mesh], *skin ? &**skin : nullptr,
                          gltf_path("meshes", mesh));
    if (!data) return tl::unexpected(std::move(data.error()));
    asset.nodes[static_cast<size_t>(asset_node_of[i])].mesh = static_cast<int>(read.size());
    asset.mesh_names.push_back(document.model.meshes[mesh].name);
    asset.mesh_double_sided.push_back(is_double_sided(document.model.meshes[mesh], asset));
    read.push_back({std::move(*data), gltf_path("meshes", mesh)});
  }
  return {};
}

}  // namespace

Status read_gltf_meshes(GltfDocument& document, GeometryStore& store, const std::vector<int>& asset_node_of,
                        SceneAsset& asset) {
  const auto& meshes = document.model.meshes;
  warn_of_masks(document);
  read_materials(document, asset);
  const std::vector<bool> plain = meshes_without_skin(document.model);
  std::vector<ReadMesh> read;
  for (size_t i = 0; i < meshes.size(); ++i) {
    Result<MeshData> mesh = MeshData{};
    if (plain[i]) mesh = read_mesh(document, asset, meshes[i], nullptr, gltf_path("meshes", i));
    if (!mesh) return tl::unexpected(std::move(mesh.error()));
    read.push_back({std::move(*mesh), gltf_path("meshes", i)});
    asset.mesh_names.push_back(meshes[i].name);
    asset.mesh_double_sided.push_back(is_double_sided(meshes[i], asset));
  }
  if (const Status s = read_skinned(document, asset_node_of, asset, read); !s) return s;
  std::vector<Result<std::shared_ptr<const Geometry>>> built(read.size());
  parallel_for(read.size(), [&](size_t i) {
    built[i] = build_mesh(std::move(read[i].data), read[i].field, store, document.work.limit());
  });
  for (auto& geometry : built) {
    if (!geometry) return tl::unexpected(std::move(geometry.error()));
    asset.meshes.push_back(std::move(*geometry));
  }
  return {};
}

}  // namespace sightline
