// Each feature of the reader on a file made by hand, checked by value.
#include "server/scene/gltf.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/support/glb_builder.h"
#include "tests/support/triangles.h"

namespace sightline {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::array<float, 3> kO{0, 0, 0}, kX{1, 0, 0}, kY{0, 1, 0}, kXY{1, 1, 0};
const std::vector<float> kSquare = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};  // O X Y XY

class Gltf : public testing::Test {
 protected:
  std::shared_ptr<const SceneAsset> load(const std::vector<std::byte>& bytes, const ExternalFile& external = nullptr) {
    auto asset = read_gltf(bytes, external, store);
    if (!asset) {
      ADD_FAILURE() << to_string(asset.error());
      return std::make_shared<SceneAsset>();
    }
    return *asset;
  }
  std::shared_ptr<const SceneAsset> load() { return load(file.glb()); }

  // The triangles of a file with one mesh.
  std::vector<Triangle> load_triangles() {
    const auto asset = load();
    if (asset->meshes.size() != 1 || !asset->meshes[0]) return {};
    return triangles_of(*asset->meshes[0]);
  }
  Error load_error() {
    const auto asset = read_gltf(file.glb(), nullptr, store);
    if (asset) return {ErrorCode::kInternal, "", "was read without an error"};
    return asset.error();
  }
  template <typename T>
  void square_with_indices(const std::vector<T>& indices, ComponentType type, int mode = 4) {
    const int position = file.floats(kSquare);
    file.mesh_node({{"attributes", {{"POSITION", position}}},
                    {"indices", file.accessor(indices, "SCALAR", type)},
                    {"mode", mode}});
  }

  GlbBuilder file;
  GeometryStore store;
};

const std::vector<Triangle> kSquareSorted = {{kO, kX, kY}, {kY, kX, kXY}};

TEST_F(Gltf, TrianglesWithoutIndicesAreTakenInOrder) {
  file.triangle_node();
  EXPECT_EQ(load_triangles(), (std::vector<Triangle>{{kO, kX, kY}}));
}

TEST_F(Gltf, EveryIndexTypeGivesTheSameTriangles) {
  for (const ComponentType type : {kUnsignedByte, kUnsignedShort, kUnsignedInt}) {
    file = GlbBuilder();
    if (type == kUnsignedByte) square_with_indices<uint8_t>({0, 1, 2, 2, 1, 3}, type);
    if (type == kUnsignedShort) square_with_indices<uint16_t>({0, 1, 2, 2, 1, 3}, type);
    if (type == kUnsignedInt) square_with_indices<uint32_t>({0, 1, 2, 2, 1, 3}, type);
    EXPECT_EQ(load_triangles(), kSquareSorted) << type;
  }
}

TEST_F(Gltf, AStripKeepsItsWinding) {
  square_with_indices<uint8_t>({0, 1, 2, 3}, kUnsignedByte, 5);
  EXPECT_EQ(load_triangles(), kSquareSorted);
}

TEST_F(Gltf, AFanTurnsAboutItsFirstVertex) {
  square_with_indices<uint8_t>({0, 1, 3, 2}, kUnsignedByte, 6);
  EXPECT_EQ(load_triangles(), (std::vector<Triangle>{{kO, kX, kXY}, {kO, kXY, kY}}));
}

TEST_F(Gltf, PointsAndLinesAreSkippedWithAWarning) {
  for (int mode = 0; mode < 4; ++mode) {
    file = GlbBuilder();
    square_with_indices<uint8_t>({0, 1, 2, 3}, kUnsignedByte, mode);
    const auto asset = load();
    ASSERT_EQ(asset->meshes.size(), 1u);
    EXPECT_EQ(asset->meshes[0], nullptr);
    EXPECT_THAT(asset->warnings, ElementsAre("meshes[0].primitives[0]: points and lines are skipped"));
  }
}

TEST_F(Gltf, AllPrimitivesOfAMeshAreOneGeometry) {
  const int a = file.floats({0, 0, 0, 1, 0, 0, 0, 1, 0});
  const int b = file.floats({0, 1, 0, 1, 0, 0, 1, 1, 0});
  file.mesh_node({{"attributes", {{"POSITION", a}}}});
  file.json["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", b}}}});
  EXPECT_EQ(load_triangles(), kSquareSorted);
}

TEST_F(Gltf, VerticesThatNoTriangleUsesAreDropped) {
  square_with_indices<uint8_t>({1, 3, 2}, kUnsignedByte);
  const auto asset = load();
  EXPECT_EQ(asset->meshes.at(0)->positions.size(), 3u);
  EXPECT_EQ(triangles_of(*asset->meshes.at(0)), (std::vector<Triangle>{{kY, kX, kXY}}));
}

TEST_F(Gltf, InterleavedBuffersAreReadByTheirStride) {
  const std::vector<float> rows = {0, 0, 0, 9, 9, 1, 0, 0, 9, 9, 0, 1, 0, 9, 9};
  const int view = file.view(std::as_bytes(std::span(rows)), 20);
  file.mesh_node({{"attributes", {{"POSITION", file.accessor_over(view, 3, "VEC3", kFloat)}}}});
  EXPECT_EQ(load_triangles(), (std::vector<Triangle>{{kO, kX, kY}}));
}

TEST_F(Gltf, AnAccessorOffsetIsAddedToTheViewOffset) {
  file.view(std::as_bytes(std::span(kSquare)));  // something in front, so that the view has an offset too
  const std::vector<float> rows = {7, 7, 7, 0, 0, 0, 1, 0, 0, 0, 1, 0};
  const int position = file.accessor_over(file.view(std::as_bytes(std::span(rows))), 3, "VEC3", kFloat);
  file.json["accessors"][position]["byteOffset"] = 12;
  file.mesh_node({{"attributes", {{"POSITION", position}}}});
  EXPECT_EQ(load_triangles(), (std::vector<Triangle>{{kO, kX, kY}}));
}

json sparse(GlbBuilder& file, const std::vector<uint16_t>& indices, const std::vector<float>& values) {
  return {{"count", indices.size()},
          {"indices", {{"bufferView", file.view(std::as_bytes(std::span(indices)))}, {"componentType", 5123}}},
          {"values", {{"bufferView", file.view(std::as_bytes(std::span(values)))}}}};
}

TEST_F(Gltf, SparseValuesReplaceTheBase) {
  const int position = file.floats({0, 0, 0, 5, 5, 5, 0, 1, 0});
  file.json["accessors"][position]["sparse"] = sparse(file, {1}, {1, 0, 0});
  file.mesh_node({{"attributes", {{"POSITION", position}}}});
  EXPECT_EQ(load_triangles(), (std::vector<Triangle>{{kO, kX, kY}}));
}

TEST_F(Gltf, ASparseAccessorWithoutABaseStartsFromZero) {
  const int position = file.accessor_over(-1, 3, "VEC3", kFloat);
  file.json["accessors"][position]["sparse"] = sparse(file, {1, 2}, {1, 0, 0, 0, 1, 0});
  file.mesh_node({{"attributes", {{"POSITION", position}}}});
  EXPECT_EQ(load_triangles(), (std::vector<Triangle>{{kO, kX, kY}}));
}

TEST_F(Gltf, IndicesMayBeSparseOverNothing) {
  const int position = file.floats(kSquare);
  const int indices = file.accessor_over(-1, 3, "SCALAR", kUnsignedShort);
  const std::vector<uint16_t> places = {1, 2}, values = {1, 2};
  file.json["accessors"][indices]["sparse"] = {
      {"count", 2},
      {"indices", {{"bufferView", file.view(std::as_bytes(std::span(places)))}, {"componentType", 5123}}},
      {"values", {{"bufferView", file.view(std::as_bytes(std::span(values)))}}}};
  file.mesh_node({{"attributes", {{"POSITION", position}}}, {"indices", indices}});
  EXPECT_EQ(load_triangles(), (std::vector<Triangle>{{kO, kX, kY}}));
}

TEST_F(Gltf, SparseIndicesMustRiseStrictlyAndStayInside) {
  for (const std::vector<uint16_t>& wrong : {std::vector<uint16_t>{2, 1}, {1, 1}, {1, 3}}) {
    file = GlbBuilder();
    const int position = file.floats({0, 0, 0, 1, 0, 0, 0, 1, 0});
    file.json["accessors"][position]["sparse"] = sparse(file, wrong, {1, 0, 0, 0, 1, 0});
    file.mesh_node({{"attributes", {{"POSITION", position}}}});
    EXPECT_EQ(load_error().field, "accessors[0].sparse.indices");
  }
}

TEST_F(Gltf, QuantizedPositionsKeepPlainIntegersAndScaleNormalizedOnes) {
  file.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  const std::vector<int8_t> rows = {0, 0, 0, 0, 127, 0, 0, 0, 0, -127, 0, 0};
  const int view = file.view(std::as_bytes(std::span(rows)), 4);
  file.mesh_node({{"attributes", {{"POSITION", file.accessor_over(view, 3, "VEC3", kByte)}}}});
  file.mesh_node({{"attributes", {{"POSITION", file.accessor_over(view, 3, "VEC3", kByte, true)}}}});
  const auto asset = load();
  ASSERT_EQ(asset->meshes.size(), 2u);
  EXPECT_EQ(asset->meshes[0]->bounds.max, glm::vec3(127, 0, 0));
  EXPECT_EQ(asset->meshes[0]->bounds.min, glm::vec3(0, -127, 0));
  EXPECT_EQ(asset->meshes[1]->bounds.max, glm::vec3(1, 0, 0));
  EXPECT_EQ(asset->meshes[1]->bounds.min, glm::vec3(0, -1, 0));
}

TEST_F(Gltf, NormalizedShortsReachExactlyOne) {
  const std::vector<uint16_t> rows = {0, 0, 0, 0, 65535, 0, 0, 0, 0, 32767, 0, 0};
  const int view = file.view(std::as_bytes(std::span(rows)), 8);
  file.mesh_node({{"attributes", {{"POSITION", file.accessor_over(view, 3, "VEC3", kUnsignedShort, true)}}}});
  const auto asset = load();
  EXPECT_EQ(asset->meshes.at(0)->bounds.max.x, 1.0f);
  EXPECT_FLOAT_EQ(asset->meshes.at(0)->bounds.max.y, 32767.0f / 65535.0f);
}

TEST_F(Gltf, TheMostNegativeIntegerIsMinusOneAndNotBelow) {
  const std::vector<int16_t> rows = {0, 0, 0, 0, -32768, 0, 0, 0, 0, 32767, 0, 0};
  const int view = file.view(std::as_bytes(std::span(rows)), 8);
  file.mesh_node({{"attributes", {{"POSITION", file.accessor_over(view, 3, "VEC3", kShort, true)}}}});
  EXPECT_EQ(load()->meshes.at(0)->bounds.min.x, -1.0f);
}

TEST_F(Gltf, NodesMultiplyDownTheHierarchy) {
  const int leaf = file.triangle_node();
  file.json["nodes"][leaf]["translation"] = {1, 0, 0};
  file.add("nodes", {{"name", "parent"},
                     {"children", {leaf}},
                     {"scale", {2, 2, 2}},
                     {"rotation", {0, 0, std::sqrt(0.5), std::sqrt(0.5)}},
                     {"translation", {0, 0, 5}}});
  const auto asset = load();
  ASSERT_EQ(asset->nodes.size(), 2u);
  EXPECT_EQ(asset->nodes[0].name, "parent");
  EXPECT_EQ(asset->nodes[1].parent, 0);
  // (1,0,0) doubled, turned a quarter about Z, lifted by 5.
  const glm::dvec3 origin = rest_world_from_node(*asset)[1][3];
  EXPECT_NEAR(glm::length(origin - glm::dvec3(0, 2, 5)), 0.0, 1e-12);
}

TEST_F(Gltf, AMatrixEqualsTheTrsThatItIsMadeOf) {
  const int a = file.triangle_node();
  file.json["nodes"][a]["matrix"] = {0, 2, 0, 0, -3, 0, 0, 0, 0, 0, 4, 0, 5, 6, 7, 1};  // scale 2 3 4, quarter turn
  const auto asset = load();
  const AssetNode& node = asset->nodes.at(0);
  EXPECT_NEAR(glm::length(node.scale - glm::dvec3(2, 3, 4)), 0.0, 1e-12);
  EXPECT_NEAR(glm::length(node.translation_m - glm::dvec3(5, 6, 7)), 0.0, 1e-12);
  EXPECT_NEAR(std::abs(glm::dot(node.rotation, glm::dquat(std::sqrt(0.5), 0, 0, std::sqrt(0.5)))), 1.0, 1e-12);
  EXPECT_TRUE(node.decomposed);
}

TEST_F(Gltf, AMirroringMatrixDecomposesToANegativeScale) {
  const int a = file.triangle_node();
  file.json["nodes"][a]["matrix"] = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  const AssetNode node = load()->nodes.at(0);
  ASSERT_TRUE(node.decomposed);
  const Affine made = make_affine(node.translation_m, node.rotation, node.scale);
  for (int column = 0; column < 4; ++column)
    EXPECT_NEAR(glm::length(made[column] - node.parent_from_node[column]), 0.0, 1e-12);
}

TEST_F(Gltf, AShearedMatrixIsKeptWholeWithAWarning) {
  const int a = file.triangle_node();
  file.json["nodes"][a]["matrix"] = {1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  const auto asset = load();
  EXPECT_FALSE(asset->nodes.at(0).decomposed);
  EXPECT_EQ(asset->nodes.at(0).parent_from_node[1], glm::dvec3(1, 1, 0));
  EXPECT_THAT(asset->warnings, ElementsAre(HasSubstr("nodes[0].matrix")));
}

TEST_F(Gltf, OnlyTheDefaultSceneIsRead) {
  file.triangle_node();
  file.triangle_node();
  file.json["nodes"][1]["name"] = "shown";
  file.add("scenes", {{"nodes", {0}}});
  file.add("scenes", {{"nodes", {1}}});
  file.json["scene"] = 1;
  const auto asset = load();
  ASSERT_EQ(asset->nodes.size(), 1u);
  EXPECT_EQ(asset->nodes[0].name, "shown");
}

TEST_F(Gltf, GpuInstancesAreReadWithQuantizedRotations) {
  file.json["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  const int node = file.triangle_node();
  const int translation = file.floats({1, 2, 3, 4, 5, 6});
  const int rotation = file.accessor<int16_t>({0, 0, 0, 32767, 0, 0, 32767, 0}, "VEC4", kShort, true);
  const int scale = file.floats({1, 1, 1, 2, 2, 2});
  file.json["nodes"][node]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
      {"TRANSLATION", translation}, {"ROTATION", rotation}, {"SCALE", scale}};
  const auto asset = load();
  ASSERT_EQ(asset->nodes.at(0).gpu_instances.size(), 2u);
  EXPECT_EQ(asset->triangle_count(), 2u);
  const Affine& second = asset->nodes[0].gpu_instances[1];
  EXPECT_NEAR(glm::length(transform_point(second, {1, 0, 0}) - glm::dvec3(2, 5, 6)), 0.0,
              1e-9);  // half turn, doubled
}

TEST_F(Gltf, GpuInstanceAttributesMustBeEquallyLong) {
  const int node = file.triangle_node();
  const int translation = file.floats({1, 2, 3, 4, 5, 6});
  const int scale = file.floats({1, 1, 1});
  file.json["nodes"][node]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", translation},
                                                                                     {"SCALE", scale}};
  EXPECT_EQ(load_error().field, "nodes[0].extensions.EXT_mesh_gpu_instancing.attributes.SCALE");
}

TEST_F(Gltf, MorphTargetsAndMeshesWithoutJointsStayAtRestWithAWarning) {
  const int node = file.triangle_node();
  file.json["nodes"][node]["skin"] = 0;
  file.add("skins", {{"joints", {node}}});
  file.json["meshes"][0]["primitives"][0]["targets"] = json::array({{{"POSITION", 0}}});
  const auto asset = load();
  EXPECT_EQ(asset->triangle_count(), 1u);
  EXPECT_THAT(asset->warnings, testing::UnorderedElementsAre(HasSubstr("meshes[0].primitives[0]: has no JOINTS_0"),
                                                             HasSubstr("meshes[0].primitives[0].targets")));
}

TEST_F(Gltf, FlagsMayBeWrittenAsNumbers) {
  for (const auto& [written, flag] : {std::pair<json, bool>{true, true}, {false, false}, {1, true}, {0, false}}) {
    file = GlbBuilder();
    const int node = file.triangle_node();
    for (const char* key : {"occludes", "collides", "visible"})
      file.json["nodes"][node]["extras"]["sightline"][key] = written;
    const InstanceAttributes attributes = load()->nodes.at(0).attributes;
    EXPECT_EQ(attributes.occludes, flag) << written;
    EXPECT_EQ(attributes.collides, flag) << written;
    EXPECT_EQ(attributes.visible, flag) << written;
    file.json["nodes"][node]["extras"]["sightline"]["collides"] = 2;
    EXPECT_EQ(load_error().field, "nodes[0].extras.sightline.collides");
  }
}

// KHR_node_visibility, as Godot 4.5 writes it: a hidden node hides all that is below it.
TEST_F(Gltf, NodesThatTheFileHidesAreHiddenWithAllBelowThem) {
  const int seen = file.triangle_node(), hidden = file.triangle_node(), below = file.triangle_node(),
            shown_below = file.triangle_node();
  file.json["extensionsRequired"] = {"KHR_node_visibility"};
  file.json["nodes"][hidden]["extensions"]["KHR_node_visibility"] = {{"visible", false}};
  file.json["nodes"][shown_below]["extensions"]["KHR_node_visibility"] = {{"visible", true}};
  file.json["nodes"][hidden]["children"] = {below};
  file.json["nodes"][below]["children"] = {shown_below};
  file.json["scenes"] = json::array({{{"nodes", {seen, hidden}}}});
  const auto asset = load();
  ASSERT_EQ(asset->nodes.size(), 4u);
  EXPECT_TRUE(asset->nodes[0].attributes.visible);
  for (const size_t node : {1, 2, 3}) EXPECT_FALSE(asset->nodes[node].attributes.visible) << node;
  file.json["nodes"][hidden]["extensions"]["KHR_node_visibility"] = {{"visible", 0}};
  EXPECT_EQ(load_error().field, "nodes[1].extensions.KHR_node_visibility.visible");
}

// Glass that lets light through hides nothing. What a mask cuts out of a leaf cannot be known without the texture.
TEST_F(Gltf, TransmissionIsSeenThroughAndAMaskIsWarnedOf) {
  const int glass = file.triangle_node(), frosted = file.triangle_node(), leaf = file.triangle_node();
  const auto material = [&](int node, json of) {
    const int mesh = file.json["nodes"][node]["mesh"];
    file.json["meshes"][mesh]["primitives"][0]["material"] = file.add("materials", std::move(of));
  };
  material(glass, {{"extensions", {{"KHR_materials_transmission", {{"transmissionFactor", 0.9}}}}}});
  material(frosted, {{"extensions", {{"KHR_materials_transmission", {{"transmissionFactor", 0.1}}}}}});
  material(leaf, {{"alphaMode", "MASK"}});
  const auto asset = load();
  ASSERT_EQ(asset->meshes.size(), 3u);
  EXPECT_EQ(asset->meshes[0]->occluding_index_count, 0u);
  EXPECT_EQ(asset->meshes[1]->occluding_index_count, 3u);
  EXPECT_EQ(asset->meshes[2]->occluding_index_count, 3u);
  ASSERT_EQ(asset->warnings.size(), 1u);
  EXPECT_THAT(asset->warnings[0], HasSubstr("materials[2].alphaMode"));
}

TEST_F(Gltf, ARequiredExtensionThatIsNotSupportedIsNamed) {
  for (const char* name : {"KHR_gaussian_splatting", "ACME_x"}) {
    file = GlbBuilder();
    file.triangle_node();
    file.json["extensionsRequired"] = {"KHR_mesh_quantization", name};
    const Error error = load_error();
    EXPECT_EQ(error.code, ErrorCode::kUnsupported);
    EXPECT_EQ(error.field, "extensionsRequired[1]");
    EXPECT_THAT(error.message, HasSubstr(name));
  }
}

TEST_F(Gltf, RequiredExtensionsThatLeaveGeometryAloneAreRead) {
  file.triangle_node();
  file.json["extensionsRequired"] = {"KHR_materials_unlit", "KHR_texture_transform", "EXT_texture_webp",
                                     "KHR_lights_punctual"};
  file.json["extensionsUsed"] = file.json["extensionsRequired"];
  EXPECT_THAT(load()->extensions_used, testing::SizeIs(4));
}

TEST_F(Gltf, BlendedMaterialsBelowTheOccludingOpacityAreSeeThrough) {
  const int clear = file.floats({0, 1, 0, 1, 0, 0, 1, 1, 0});
  const int solid = file.floats({0, 0, 0, 1, 0, 0, 0, 1, 0});
  file.add("materials", {{"alphaMode", "BLEND"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.5}}}}});
  file.add("materials", {{"alphaMode", "BLEND"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.75}}}}});
  file.mesh_node({{"attributes", {{"POSITION", clear}}}, {"material", 0}});
  file.json["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", solid}}}, {"material", 1}});
  const auto asset = load();
  const Geometry& geometry = *asset->meshes.at(0);
  EXPECT_EQ(geometry.triangle_count(), 2u);
  ASSERT_EQ(geometry.occluding_index_count, 3u);
  EXPECT_EQ(geometry.positions[geometry.indices[0]].y + geometry.positions[geometry.indices[1]].y +
                geometry.positions[geometry.indices[2]].y,
            1.0f);  // the solid one
}

TEST_F(Gltf, AnOpaqueMaterialIgnoresItsAlpha) {
  file.add("materials", {{"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.1}}}}});
  file.triangle_node();
  file.json["meshes"][0]["primitives"][0]["material"] = 0;
  EXPECT_EQ(load()->meshes.at(0)->occluding_index_count, 3u);
}

TEST_F(Gltf, ExtrasGiveAttributesAndStayReadable) {
  const int node = file.triangle_node();
  file.json["nodes"][node]["extras"] = {{"author", "x"},
                                        {"sightline",
                                         {{"layers", 6},
                                          {"opacity", 0.5},
                                          {"occludes", false},
                                          {"collides", false},
                                          {"visible", false},
                                          {"role", "target"}}}};
  const auto asset = load();
  EXPECT_EQ(asset->nodes.at(0).attributes, (InstanceAttributes{6, 0.5f, false, false, false}));
  EXPECT_EQ(json::parse(asset->nodes[0].extras_json), file.json["nodes"][node]["extras"]);
}

TEST_F(Gltf, WrongExtrasAreNamed) {
  const std::vector<std::pair<json, std::string>> cases = {
      {{{"opacity", 1.5}}, ".opacity"},  {{{"opacity", "1"}}, ".opacity"},      {{{"layers", -1}}, ".layers"},
      {{{"layers", 1.5}}, ".layers"},    {{{"layers", 4294967296}}, ".layers"}, {{{"occludes", 2}}, ".occludes"},
      {{{"collides", -1}}, ".collides"}, {{{"visible", "no"}}, ".visible"},     {json(3), ""},
  };
  for (const auto& [value, suffix] : cases) {
    file = GlbBuilder();
    for (int i = 0; i < 4; ++i) file.triangle_node();
    file.json["nodes"][3]["extras"]["sightline"] = value;
    EXPECT_EQ(load_error().field, "nodes[3].extras.sightline" + suffix) << value;
  }
}

TEST_F(Gltf, PerspectiveCamerasAreReadAndOrthographicOnesSkipped) {
  file.add("cameras",
           {{"type", "orthographic"}, {"orthographic", {{"xmag", 1}, {"ymag", 1}, {"znear", 0.1}, {"zfar", 10}}}});
  file.add("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.25}}}});
  file.add("nodes", {{"camera", 0}});
  file.add("nodes", {{"camera", 1}});
  const auto asset = load();
  ASSERT_EQ(asset->cameras.size(), 1u);
  EXPECT_EQ(asset->cameras[0].vertical_fov_rad, 0.5);
  EXPECT_EQ(asset->cameras[0].near_m, 0.25);
  EXPECT_FALSE(asset->cameras[0].aspect);
  EXPECT_EQ(asset->nodes.at(0).camera, -1);
  EXPECT_EQ(asset->nodes.at(1).camera, 0);
}

TEST_F(Gltf, DataUrisAndFilesGiveTheSameGeometryAsAGlb) {
  square_with_indices<uint8_t>({0, 1, 2, 2, 1, 3}, kUnsignedByte);
  const auto glb = load();
  const auto data = load(file.gltf_with_data_uri());
  std::string asked;
  const auto external = load(file.gltf("my%20mesh.bin"),
                             [&](const std::string& path) -> Result<std::vector<std::byte>> {
                               asked = path;
                               return std::vector<std::byte>(file.binary().begin(), file.binary().end());
                             });
  EXPECT_EQ(asked, "my mesh.bin");
  ASSERT_TRUE(glb->meshes.at(0));
  EXPECT_EQ(data->meshes.at(0), glb->meshes[0]) << "the same object: the store keeps one copy";
  EXPECT_EQ(external->meshes.at(0), glb->meshes[0]);
}

TEST_F(Gltf, PercentEscapesOfAFileNameMayHaveLettersOfEitherCase) {
  file.triangle_node();
  std::string asked;
  load(file.gltf("%41%5a%5F%7a%c3%A9%2D%6f%39.bin"), [&](const std::string& path) -> Result<std::vector<std::byte>> {
    asked = path;
    return std::vector<std::byte>(file.binary().begin(), file.binary().end());
  });
  EXPECT_EQ(asked, "AZ_z\xc3\xa9-o9.bin");
}

TEST_F(Gltf, TheHashCoversTheFileAndWhatItRefersTo) {
  file.triangle_node();
  const auto read_with = [&](float x) {
    std::vector<std::byte> bytes(file.binary().begin(), file.binary().end());
    std::memcpy(bytes.data() + 12, &x, sizeof x);
    return load(file.gltf("a.bin"), [&](const std::string&) -> Result<std::vector<std::byte>> { return bytes; })->hash;
  };
  EXPECT_EQ(read_with(1.0f), read_with(1.0f));
  EXPECT_NE(read_with(1.0f), read_with(2.0f));
  const ContentHash before = load()->hash;
  file.json["asset"]["generator"] = "other";
  EXPECT_NE(load()->hash, before);
}

TEST_F(Gltf, ABufferMayBeShorterThanTheFileBehindIt) {
  file.triangle_node();
  const auto asset = load(file.gltf("a.bin"), [&](const std::string&) -> Result<std::vector<std::byte>> {
    std::vector<std::byte> bytes(file.binary().begin(), file.binary().end());
    bytes.resize(bytes.size() + 100);
    return bytes;
  });
  EXPECT_EQ(asset->triangle_count(), 1u);
}

TEST_F(Gltf, ImagesAreNeitherOpenedNorDecoded) {
  file.triangle_node();
  file.add("images", {{"uri", "../../secret.png"}});
  file.add("images", {{"bufferView", 0}, {"mimeType", "image/png"}});
  file.add("textures", {{"source", 0}});
  EXPECT_EQ(load()->triangle_count(), 1u);
}

TEST_F(Gltf, AnEmptySceneIsAnEmptyAsset) {
  const auto asset = load();
  EXPECT_TRUE(asset->nodes.empty());
  EXPECT_EQ(asset->triangle_count(), 0u);
}

TEST_F(Gltf, AMeshOfDegenerateTrianglesOnlyIsEmpty) {
  file.mesh_node({{"attributes", {{"POSITION", file.floats({1, 1, 1, 1, 1, 1, 1, 1, 1})}}}});
  EXPECT_EQ(load()->meshes.at(0), nullptr);
}

}  // namespace
}  // namespace sightline
