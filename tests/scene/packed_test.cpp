// Packed files are made from known meshes with the libraries' encoders, read back, and compared with the meshes. Then
// the same files are damaged; run under AddressSanitizer to give "no crash" its full meaning.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "client/command/scene_command.h"
#include "server/base/random.h"
#include "server/scene/gltf.h"
#include "tests/scene/packed_mesh.h"
#include "tests/support/peak_memory.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/triangles.h"

namespace sightline {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::StartsWith;

const std::string kDracoField = "meshes[0].primitives[0].extensions.KHR_draco_mesh_compression";

std::shared_ptr<const SceneAsset> load(const std::vector<std::byte>& glb, const ExternalFile& external = nullptr) {
  GeometryStore store;
  auto asset = read_gltf(glb, external, store);
  if (asset) return *asset;
  ADD_FAILURE() << to_string(asset.error());
  return std::make_shared<SceneAsset>();
}

Error error_of(const std::vector<std::byte>& glb, const GltfLimits& limits = {}) {
  GeometryStore store;
  const auto asset = read_gltf(glb, nullptr, store, limits);
  return asset ? Error{ErrorCode::kInternal, "", "was read without an error"} : asset.error();
}

std::vector<Triangle> triangles_in(const std::vector<std::byte>& glb) {
  const auto asset = load(glb);
  return asset->meshes.size() == 1 && asset->meshes[0] ? triangles_of(*asset->meshes[0]) : std::vector<Triangle>();
}

// The greatest distance between corners of `a` and the matching corners of `b`, under the rotation of `b`'s corners
// that fits best.
float distance(const Triangle& a, const Triangle& b) {
  float best = std::numeric_limits<float>::infinity();
  for (size_t turn = 0; turn < 3; ++turn) {
    float worst = 0.0f;
    for (size_t k = 0; k < 3; ++k)
      for (size_t axis = 0; axis < 3; ++axis) worst = std::max(worst, std::abs(a[k][axis] - b[(k + turn) % 3][axis]));
    best = std::min(best, worst);
  }
  return best;
}

// Every triangle of one set matches a different triangle of the other, with no corner farther than `step_m` along any
// axis.
void expect_same_within(const std::vector<Triangle>& wanted, std::vector<Triangle> found, float step_m) {
  ASSERT_EQ(found.size(), wanted.size());
  for (const Triangle& t : wanted) {
    const auto nearest = std::min_element(found.begin(), found.end(), [&](const Triangle& a, const Triangle& b) {
      return distance(t, a) < distance(t, b);
    });
    ASSERT_LE(distance(t, *nearest), step_m);
    found.erase(nearest);
  }
}

template <typename T>
std::span<const std::byte> raw(const std::vector<T>& values) {
  return std::as_bytes(std::span(values));
}

TEST(Meshopt, FloatsAndIndicesAreReadExactly) {
  const MeshData mesh = hills(9);
  for (const size_t index_bytes : {2, 4}) {
    PackedFile file;
    file.meshopt_node(mesh, index_bytes);
    EXPECT_EQ(triangles_in(file.packed_glb()), triangles_of(mesh)) << index_bytes;
  }
}

TEST(Meshopt, AnIndexSequenceDrawsAStrip) {
  PackedFile file;
  const std::vector<float> square = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
  const std::vector<uint32_t> strip = {0, 1, 2, 3};
  const int position = file.accessor_over(file.packed_view(meshopt_attributes(raw(square), 12), 4, 12, "ATTRIBUTES"), 4,
                                          "VEC3", kFloat);
  const int index = file.accessor_over(file.packed_view(meshopt_sequence(strip, 4), 4, 2, "INDICES"), 4, "SCALAR",
                                       kUnsignedShort);
  file.mesh_node({{"attributes", {{"POSITION", position}}}, {"indices", index}, {"mode", 5}});
  const MeshData wanted{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}, {0, 1, 2, 1, 3, 2}};
  EXPECT_EQ(triangles_in(file.packed_glb()), triangles_of(wanted));
}

// The same quantised bytes, once packed and once as they are.
TEST(Meshopt, QuantizedPositionsEqualThoseOfThePlainFile) {
  const MeshData mesh = hills(8);
  std::vector<int16_t> quantized;
  for (const glm::vec3& p : mesh.positions)
    for (const float value : {p.x, p.y, p.z, 0.0f}) quantized.push_back(static_cast<int16_t>(value * 1000.0f));
  GlbBuilder plain;
  const int plain_position = plain.accessor_over(plain.view(raw(quantized), 8), mesh.positions.size(), "VEC3", kShort,
                                                 true);
  plain.mesh_node({{"attributes", {{"POSITION", plain_position}}},
                   {"indices", plain.accessor(mesh.indices, "SCALAR", kUnsignedInt)}});

  PackedFile file;
  const int position = file.accessor_over(
      file.packed_view(meshopt_attributes(raw(quantized), 8), mesh.positions.size(), 8, "ATTRIBUTES"),
      mesh.positions.size(), "VEC3", kShort, true);
  const int index = file.accessor_over(
      file.packed_view(meshopt_triangles(mesh.indices, mesh.positions.size()), mesh.indices.size(), 4, "TRIANGLES"),
      mesh.indices.size(), "SCALAR", kUnsignedInt);
  file.mesh_node({{"attributes", {{"POSITION", position}}}, {"indices", index}});
  const auto triangles = triangles_in(file.packed_glb());
  EXPECT_EQ(triangles.size(), 128u);
  EXPECT_EQ(triangles, triangles_in(plain.glb()));
}

TEST(Meshopt, TheExponentialFilterKeepsItsBits) {
  const MeshData mesh = hills(7);
  std::vector<std::byte> filtered(mesh.positions.size() * sizeof(glm::vec3));
  meshopt_encodeFilterExp(filtered.data(), mesh.positions.size(), sizeof(glm::vec3), 16, &mesh.positions[0].x);
  PackedFile file;
  const int position = file.accessor_over(
      file.packed_view(meshopt_attributes(filtered, 12), mesh.positions.size(), 12, "ATTRIBUTES", "EXPONENTIAL"),
      mesh.positions.size(), "VEC3", kFloat);
  file.mesh_node(
      {{"attributes", {{"POSITION", position}}}, {"indices", file.accessor(mesh.indices, "SCALAR", kUnsignedInt)}});
  // 15 bits and a sign of the vector's greatest component, which is below 16 m.
  expect_same_within(triangles_of(mesh), triangles_in(file.packed_glb()), 16.0f / 32768.0f);
}

TEST(Meshopt, TheOctahedralFilterMakesUnitVectors) {
  std::vector<float> directions;  // x y z w
  for (int i = 0; i < 30; ++i) {
    const double turn = 0.9 * i, height = -0.95 + i / 16.0, ring = std::sqrt(1 - height * height);
    for (const double value : {ring * std::cos(turn), height, ring * std::sin(turn), 0.0})
      directions.push_back(static_cast<float>(value));
  }
  std::vector<std::byte> filtered(30 * 8);
  meshopt_encodeFilterOct(filtered.data(), 30, 8, 16, directions.data());
  PackedFile file;
  file.mesh_node({{"attributes",
                   {{"POSITION", file.accessor_over(file.packed_view(meshopt_attributes(filtered, 8), 30, 8,
                                                                     "ATTRIBUTES", "OCTAHEDRAL"),
                                                    30, "VEC3", kShort, true)}}}});
  MeshData wanted;
  for (uint32_t i = 0; i < 30; ++i) {
    wanted.positions.push_back({directions[4 * i], directions[4 * i + 1], directions[4 * i + 2]});
    wanted.indices.push_back(i);
  }
  expect_same_within(triangles_of(wanted), triangles_in(file.packed_glb()), 2e-4f);
}

TEST(Meshopt, TheQuaternionFilterTurnsInstances) {
  const std::vector<float> rotations = {0, 0, 0, 1, 0.5f, 0.5f, -0.5f, 0.5f, 0, 0.6f, 0, 0.8f};
  std::vector<std::byte> filtered(3 * 8);
  meshopt_encodeFilterQuat(filtered.data(), 3, 8, 16, rotations.data());
  PackedFile file;
  const int node = file.triangle_node();
  file.json["nodes"][node]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["ROTATION"] = file.accessor_over(
      file.packed_view(meshopt_attributes(filtered, 8), 3, 8, "ATTRIBUTES", "QUATERNION"), 3, "VEC4", kShort, true);
  const auto asset = load(file.packed_glb());
  ASSERT_EQ(asset->nodes.at(0).gpu_instances.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    const glm::dquat wanted(rotations[4 * i + 3], rotations[4 * i], rotations[4 * i + 1], rotations[4 * i + 2]);
    const Affine& found = asset->nodes[0].gpu_instances[i];
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(glm::length(found[axis] - glm::mat3_cast(wanted)[axis]), 0.0, 2e-4) << i;
  }
}

// The fallback holds other triangles, so the result shows what was read.
TEST(Meshopt, ThePackedDataIsReadAndTheFallbackIsNotEvenOpened) {
  PackedFile file;
  const MeshData mesh = hills(4);
  file.meshopt_node(mesh, 2);
  file.packed_glb();
  file.json["buffers"][1]["uri"] = "fallback.bin";
  file.json["buffers"][1]["extensions"]["EXT_meshopt_compression"]["fallback"] = true;
  file.json.erase("extensionsRequired");
  int opened = 0;
  const auto asset = load(file.glb(), [&](const std::string&) -> Result<std::vector<std::byte>> {
    ++opened;
    return std::vector<std::byte>(4096, std::byte{0});
  });
  EXPECT_EQ(triangles_of(*asset->meshes.at(0)), triangles_of(mesh));
  EXPECT_EQ(opened, 0);
}

TEST(Meshopt, AViewThatNothingNeedsIsLeftPacked) {
  PackedFile file;
  file.meshopt_node(hills(4), 2);
  const std::vector<std::byte> nonsense(64, std::byte{0x55});
  file.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = file.accessor_over(
      file.packed_view(nonsense, 25, 12, "ATTRIBUTES"), 25, "VEC3", kFloat);
  EXPECT_EQ(triangles_in(file.packed_glb()).size(), 32u);
}

// As if the file had been written with the extension's later name.
void take_khronos_name(PackedFile& file) {
  for (json& view : file.json["bufferViews"]) {
    json& extensions = view["extensions"];
    extensions["KHR_meshopt_compression"] = extensions["EXT_meshopt_compression"];
    extensions.erase("EXT_meshopt_compression");
  }
  file.json["extensionsRequired"] = {"KHR_meshopt_compression"};
}

TEST(Meshopt, TheKhronosNameMeansTheSame) {
  PackedFile file;
  const MeshData mesh = hills(4);
  file.meshopt_node(mesh, 2);
  const std::vector<std::byte> nonsense(64, std::byte{0x55});
  file.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = file.accessor_over(
      file.packed_view(nonsense, 25, 4, "ATTRIBUTES", "COLOR"), 25, "VEC4", kUnsignedByte, true);
  file.packed_glb();
  take_khronos_name(file);
  EXPECT_EQ(triangles_in(file.glb()), triangles_of(mesh));
  file.json["bufferViews"][0]["extensions"]["KHR_meshopt_compression"]["count"] = 24;
  EXPECT_EQ(error_of(file.glb()).field, "bufferViews[0].extensions.KHR_meshopt_compression");
}

// The KHR extension adds a second version of the attribute codec, and a filter for colours.
TEST(Meshopt, WhatTheLibraryLacksIsNotSupported) {
  PackedFile file;
  const MeshData mesh = hills(4);
  std::vector<std::byte> positions = meshopt_attributes(raw(mesh.positions), sizeof(glm::vec3));
  positions[0] = std::byte{0xA1};
  file.mesh_node(
      {{"attributes",
        {{"POSITION", file.accessor_over(file.packed_view(positions, 25, 12, "ATTRIBUTES"), 25, "VEC3", kFloat)}}}});
  file.packed_glb();
  take_khronos_name(file);
  const Error later = error_of(file.glb());
  EXPECT_EQ(later.code, ErrorCode::kUnsupported);
  EXPECT_EQ(later.field, "bufferViews[0].extensions.KHR_meshopt_compression");
  PackedFile colour;
  colour.mesh_node({{"attributes",
                     {{"POSITION", colour.accessor_over(colour.packed_view(positions, 24, 8, "ATTRIBUTES", "COLOR"), 24,
                                                        "VEC3", kShort)}}}});
  positions[0] = std::byte{0xA0};
  EXPECT_EQ(error_of(colour.packed_glb()).code, ErrorCode::kUnsupported);
}

// One thing wrong in the description of view 0, the positions (12 bytes, 25 of them), or of view 1, the indices.
struct WrongPacking {
  const char* name;
  void (*spoil)(PackedFile&);
  ErrorCode code;
  const char* field;  // below bufferViews
};
void PrintTo(const WrongPacking& wrong, std::ostream* out) {
  *out << wrong.name;
}

class MeshoptWrong : public testing::TestWithParam<WrongPacking> {};
TEST_P(MeshoptWrong, IsAnErrorThatNamesTheField) {
  PackedFile file;
  file.meshopt_node(hills(4), 2);
  file.packed_glb();
  GetParam().spoil(file);
  const Error error = error_of(file.glb());
  EXPECT_EQ(error.code, GetParam().code) << error.message;
  EXPECT_EQ(error.field, std::string("bufferViews") + GetParam().field);
}
INSTANTIATE_TEST_SUITE_P(
    All, MeshoptWrong,
    testing::Values(WrongPacking{"NotAnObject", [](auto& f) { f.packing(0) = 7; }, ErrorCode::kInvalidArgument,
                                 "[0].extensions.EXT_meshopt_compression"},
                    WrongPacking{"NoMode", [](auto& f) { f.packing(0).erase("mode"); }, ErrorCode::kInvalidArgument,
                                 "[0].extensions.EXT_meshopt_compression.mode"},
                    WrongPacking{"UnknownMode", [](auto& f) { f.packing(0)["mode"] = "POINTS"; },
                                 ErrorCode::kInvalidArgument, "[0].extensions.EXT_meshopt_compression.mode"},
                    WrongPacking{"UnknownFilter", [](auto& f) { f.packing(0)["filter"] = "SOFT"; },
                                 ErrorCode::kInvalidArgument, "[0].extensions.EXT_meshopt_compression.filter"},
                    WrongPacking{"FilterOfIndices", [](auto& f) { f.packing(1)["filter"] = "EXPONENTIAL"; },
                                 ErrorCode::kInvalidArgument, "[1].extensions.EXT_meshopt_compression.filter"},
                    WrongPacking{"OctahedralOf12Bytes", [](auto& f) { f.packing(0)["filter"] = "OCTAHEDRAL"; },
                                 ErrorCode::kInvalidArgument, "[0].extensions.EXT_meshopt_compression.byteStride"},
                    WrongPacking{"QuaternionOf12Bytes", [](auto& f) { f.packing(0)["filter"] = "QUATERNION"; },
                                 ErrorCode::kInvalidArgument, "[0].extensions.EXT_meshopt_compression.byteStride"},
                    WrongPacking{"StrideOf10Bytes", [](auto& f) { f.packing(0)["byteStride"] = 10; },
                                 ErrorCode::kInvalidArgument, "[0].extensions.EXT_meshopt_compression.byteStride"},
                    WrongPacking{"StrideOfAKilobyte", [](auto& f) { f.packing(0)["byteStride"] = 1024; },
                                 ErrorCode::kInvalidArgument, "[0].extensions.EXT_meshopt_compression.byteStride"},
                    WrongPacking{"IndicesOf8Bytes", [](auto& f) { f.packing(1)["byteStride"] = 8; },
                                 ErrorCode::kInvalidArgument, "[1].extensions.EXT_meshopt_compression.byteStride"},
                    WrongPacking{"StrideOtherThanTheViews", [](auto& f) { f.packing(0)["byteStride"] = 16; },
                                 ErrorCode::kInvalidArgument, "[0].extensions.EXT_meshopt_compression.byteStride"},
                    WrongPacking{"FourIndicesOfTriangles", [](auto& f) { f.packing(1)["count"] = 97; },
                                 ErrorCode::kInvalidArgument, "[1].extensions.EXT_meshopt_compression.count"},
                    WrongPacking{"CountOtherThanTheViews", [](auto& f) { f.packing(0)["count"] = 24; },
                                 ErrorCode::kInvalidArgument, "[0].extensions.EXT_meshopt_compression"},
                    WrongPacking{"NoElements", [](auto& f) { f.packing(0)["count"] = 0; }, ErrorCode::kInvalidArgument,
                                 "[0].extensions.EXT_meshopt_compression.count"},
                    WrongPacking{"UnknownBuffer", [](auto& f) { f.packing(0)["buffer"] = 2; },
                                 ErrorCode::kInvalidArgument, "[0].extensions.EXT_meshopt_compression.buffer"},
                    WrongPacking{"BeyondTheBuffer", [](auto& f) { f.packing(0)["byteOffset"] = 1'000'000; },
                                 ErrorCode::kDataLoss, "[0].extensions.EXT_meshopt_compression"},
                    WrongPacking{"AnotherStream",
                                 [](auto& f) { f.packing(0)["byteOffset"] = f.packing(1)["byteOffset"]; },
                                 ErrorCode::kDataLoss, "[0].extensions.EXT_meshopt_compression"}),
    [](const auto& one) { return std::string(one.param.name); });

TEST(Meshopt, AnUnpackedViewIntoTheBufferWithoutBytesIsAnError) {
  PackedFile file;
  file.meshopt_node(hills(4), 2);
  file.packed_glb();
  file.json["accessors"][0]["bufferView"] = file.add("bufferViews", {{"buffer", 1}, {"byteLength", 300}});
  EXPECT_EQ(error_of(file.glb()).field, "buffers[1].uri");
}

TEST(Meshopt, EveryTruncationOfAStreamIsAnError) {
  PackedFile file;
  file.meshopt_node(hills(6), 2);
  file.packed_glb();
  for (const int view : {0, 1}) {
    const auto whole = file.packing(view)["byteLength"].get<size_t>();
    for (size_t length = 1; length < whole; ++length) {
      file.packing(view)["byteLength"] = length;
      const Error error = error_of(file.glb());
      EXPECT_EQ(error.code, ErrorCode::kDataLoss) << length << " of " << whole;
      EXPECT_EQ(error.field, "bufferViews[" + std::to_string(view) + "].extensions.EXT_meshopt_compression");
    }
    file.packing(view)["byteLength"] = whole;
  }
  EXPECT_EQ(triangles_in(file.glb()).size(), 72u);
}

TEST(Meshopt, NothingIsAllocatedForElementsThatTheStreamCannotHold) {
  PackedFile file;
  file.meshopt_node(hills(6), 4);
  file.packed_glb();
  for (const int view : {0, 1}) {
    file.packing(view)["count"] = 150'000'000;
    file.json["bufferViews"][view]["byteLength"] = 150'000'000 * file.packing(view)["byteStride"].get<size_t>();
  }
  file.json["buffers"][1]["byteLength"] = 3'000'000'000;
  const size_t before = peak_bytes();
  const Error error = error_of(file.glb());
  EXPECT_EQ(error.code, ErrorCode::kDataLoss) << error.message;
  EXPECT_LT(peak_bytes() - before, size_t{64} << 20);
}

TEST(Packed, UnpackedBytesHaveALimit) {
  GltfLimits limits;
  limits.max_unpacked_bytes = 1000;
  PackedFile meshopt;
  meshopt.meshopt_node(hills(9), 2);
  const Error first = error_of(meshopt.packed_glb(), limits);
  EXPECT_EQ(first.code, ErrorCode::kResourceExhausted);
  EXPECT_EQ(first.field, "bufferViews[0].extensions.EXT_meshopt_compression");
  PackedFile draco;
  draco.draco_node(hills(9), {});
  const Error second = error_of(draco.packed_glb(), limits);
  EXPECT_EQ(second.code, ErrorCode::kResourceExhausted);
  EXPECT_EQ(second.field, kDracoField);
}

TEST(Packed, TheSceneCommandSaysWhatAPackedFileHolds) {
  PackedFile file;
  file.meshopt_node(hills(6), 2);
  file.draco_node(hills(4), {});
  const auto glb = file.packed_glb();
  const test::TemporaryFolder folder;
  const auto path = folder / "packed.glb";
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(glb.data()), static_cast<std::streamsize>(glb.size()));
  std::ostringstream out, err;
  EXPECT_EQ(run_scene_command(path.string(), out, err), 0) << err.str();
  EXPECT_THAT(out.str(), HasSubstr("104 stored, 104 as instanced"));
  EXPECT_THAT(out.str(), HasSubstr("EXT_meshopt_compression, KHR_draco_mesh_compression"));
  EXPECT_THAT(out.str(), testing::ContainsRegex("positions and indices [0-9.]+ KiB, clusters [0-9.]+ KiB"));
}

// Draco returns vertices in an order of its own; only the set of triangles must be the same.
TEST(Draco, FloatsAreReadExactly) {
  const MeshData mesh = hills(9);
  for (const bool edgebreaker : {false, true}) {
    PackedFile file;
    file.draco_node(mesh, {edgebreaker, 0});
    EXPECT_EQ(triangles_in(file.packed_glb()), triangles_of(mesh)) << edgebreaker;
  }
}

TEST(Draco, QuantizedPositionsAreWithinHalfAStep) {
  const MeshData mesh = hills(9);
  for (const bool edgebreaker : {false, true}) {
    PackedFile file;
    file.draco_node(mesh, {edgebreaker, 12});
    // The longest side of the mesh is 9.9 m; half a step, and the rounding of floats.
    expect_same_within(triangles_of(mesh), triangles_in(file.packed_glb()), 0.5f * 9.9f / 4095.0f + 1e-5f);
  }
}

TEST(Draco, SurfacesThatTouchInAVertexKeepTheirTriangles) {
  const MeshData bow_tie{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {-1, 0, 0}, {-1, -1, 0}}, {0, 1, 2, 0, 3, 4}};
  PackedFile file;
  file.draco_node(bow_tie, {});
  EXPECT_EQ(triangles_in(file.packed_glb()), triangles_of(bow_tie));
}

TEST(Draco, EachPrimitiveOfAMeshIsUnpackedByItself) {
  const MeshData first = hills(3), second = hills(5);
  PackedFile file;
  file.draco_node(first, {true, 0});
  file.draco_node(second, {false, 0});
  file.json["meshes"][0]["primitives"].push_back(file.json["meshes"][1]["primitives"][0]);
  std::vector<Triangle> wanted = triangles_of(first);
  for (const Triangle& t : triangles_of(second)) wanted.push_back(t);
  std::sort(wanted.begin(), wanted.end());
  EXPECT_EQ(triangles_of(*load(file.packed_glb())->meshes.at(0)), wanted);
}

TEST(Draco, ThePackedDataIsReadAndNotTheFallback) {
  const MeshData mesh = hills(4), other = hills(5);
  PackedFile file;
  file.draco_node(mesh, {});
  json& primitive = file.json["meshes"][0]["primitives"][0];
  std::vector<float> positions(&other.positions[0].x, &other.positions[0].x + 3 * other.positions.size());
  primitive["attributes"]["POSITION"] = file.floats(positions);
  primitive["indices"] = file.accessor(other.indices, "SCALAR", kUnsignedInt);
  EXPECT_EQ(triangles_in(file.packed_glb()), triangles_of(mesh));
}

struct WrongDraco {
  const char* name;
  void (*spoil)(json& primitive, json& document);
  ErrorCode code;
  const char* field;  // below the primitive
};
void PrintTo(const WrongDraco& wrong, std::ostream* out) {
  *out << wrong.name;
}

class DracoWrong : public testing::TestWithParam<WrongDraco> {};
TEST_P(DracoWrong, IsAnErrorThatNamesTheField) {
  PackedFile file;
  file.draco_node(hills(4), {});
  file.packed_glb();
  GetParam().spoil(file.json["meshes"][0]["primitives"][0], file.json);
  const Error error = error_of(file.glb());
  EXPECT_EQ(error.code, GetParam().code) << error.message;
  EXPECT_EQ(error.field, std::string("meshes[0].primitives[0]") + GetParam().field);
}

json& packing_of(json& primitive) {
  return primitive["extensions"]["KHR_draco_mesh_compression"];
}
INSTANTIATE_TEST_SUITE_P(
    All, DracoWrong,
    testing::Values(
        WrongDraco{"NotAnObject", [](json& p, json&) { packing_of(p) = "x"; }, ErrorCode::kInvalidArgument,
                   ".extensions.KHR_draco_mesh_compression"},
        WrongDraco{"NoView", [](json& p, json&) { packing_of(p).erase("bufferView"); }, ErrorCode::kInvalidArgument,
                   ".extensions.KHR_draco_mesh_compression.bufferView"},
        WrongDraco{"UnknownView", [](json& p, json&) { packing_of(p)["bufferView"] = 9; }, ErrorCode::kInvalidArgument,
                   ".extensions.KHR_draco_mesh_compression.bufferView"},
        WrongDraco{"NoPosition", [](json& p, json&) { packing_of(p)["attributes"] = json::object(); },
                   ErrorCode::kInvalidArgument, ".extensions.KHR_draco_mesh_compression.attributes.POSITION"},
        WrongDraco{"NegativeId", [](json& p, json&) { packing_of(p)["attributes"]["POSITION"] = -1; },
                   ErrorCode::kInvalidArgument, ".extensions.KHR_draco_mesh_compression.attributes.POSITION"},
        WrongDraco{"UnknownId", [](json& p, json&) { packing_of(p)["attributes"]["POSITION"] = 5; },
                   ErrorCode::kInvalidArgument, ".extensions.KHR_draco_mesh_compression.attributes.POSITION"},
        WrongDraco{"AFan", [](json& p, json&) { p["mode"] = 6; }, ErrorCode::kInvalidArgument, ".mode"},
        WrongDraco{"PositionsOfShorts", [](json&, json& d) { d["accessors"][0]["componentType"] = 5122; },
                   ErrorCode::kInvalidArgument, ".extensions.KHR_draco_mesh_compression.attributes.POSITION"},
        WrongDraco{"MoreTrianglesThanStated", [](json&, json& d) { d["accessors"][1]["count"] = 93; },
                   ErrorCode::kResourceExhausted, ".extensions.KHR_draco_mesh_compression"},
        WrongDraco{"NoDraco",
                   [](json&, json& d) {
                     d["bufferViews"][0].update({{"byteOffset", 8}, {"byteLength", 40}});
                   },
                   ErrorCode::kDataLoss, ".extensions.KHR_draco_mesh_compression"}),
    [](const auto& one) { return std::string(one.param.name); });

// A mesh with a skin of two joints, of which one has moved and turned; the influences differ at every vertex.
struct SkinnedHills {
  MeshData mesh = hills(5);
  DracoSkin skin;

  SkinnedHills() {
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
      const float share = static_cast<float>(i % 8) / 8.0f;
      skin.joints.insert(skin.joints.end(), {0, 1, 0, 0});
      skin.weights.insert(skin.weights.end(), {1.0f - share, share, 0, 0});
    }
  }
  // Gives the node that shows the mesh its skin.
  static void add_skin(PackedFile& file, int node) {
    const int still = file.add("nodes", {{"name", "still"}});
    const int moved = file.add("nodes", {{"translation", {3, 1, 2}}, {"rotation", {0, 0.6, 0, 0.8}}});
    file.json["nodes"][node]["skin"] = file.add("skins", {{"joints", {still, moved}}});
  }
};

TEST(Draco, ASkinIsUnpackedWithItsMesh) {
  const SkinnedHills hills;
  PackedFile plain;
  const json attributes = {{"POSITION", plain.accessor_over(plain.view(raw(hills.mesh.positions)),
                                                            hills.mesh.positions.size(), "VEC3", kFloat)},
                           {"JOINTS_0", plain.accessor(hills.skin.joints, "VEC4", kUnsignedShort)},
                           {"WEIGHTS_0", plain.accessor(hills.skin.weights, "VEC4", kFloat)}};
  hills.add_skin(plain, plain.mesh_node({{"attributes", attributes},
                                         {"indices", plain.accessor(hills.mesh.indices, "SCALAR", kUnsignedInt)}}));
  const auto wanted = load(plain.packed_glb());
  ASSERT_NE(triangles_of(*wanted->meshes.at(1)), triangles_of(hills.mesh)) << "the skin must move the mesh";
  for (const bool edgebreaker : {false, true}) {
    PackedFile file;
    const int node = file.draco_node(hills.mesh, {edgebreaker, 0}, hills.skin);
    hills.add_skin(file, node);
    const auto asset = load(file.packed_glb());
    EXPECT_EQ(triangles_of(*asset->meshes.at(1)), triangles_of(*wanted->meshes.at(1))) << edgebreaker;
    EXPECT_THAT(asset->warnings, testing::IsEmpty());
  }
}

TEST(Draco, AWrongSkinIsNamed) {
  const SkinnedHills hills;
  const auto wrong = [&](const DracoSkin& skin, const std::function<void(json&)>& spoil) {
    PackedFile file;
    hills.add_skin(file, file.draco_node(hills.mesh, {}, skin));
    spoil(file.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"]);
    return error_of(file.packed_glb());
  };
  EXPECT_EQ(wrong(hills.skin, [](json& ids) { ids.erase("WEIGHTS_0"); }).field, kDracoField + ".attributes.WEIGHTS_0");
  EXPECT_EQ(wrong(hills.skin, [](json& ids) { ids["WEIGHTS_0"] = 7; }).field, kDracoField + ".attributes.WEIGHTS_0");
  EXPECT_EQ(wrong(hills.skin, [](json& ids) { ids["JOINTS_0"] = 0; }).field, kDracoField + ".attributes.JOINTS_0");
  DracoSkin beyond = hills.skin;
  beyond.joints[4] = 2;
  EXPECT_EQ(wrong(beyond, [](json&) {}).code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(wrong(beyond, [](json&) {}).field, HasSubstr("meshes[0].primitives[0].attributes.JOINTS_0["));
}

TEST(Draco, ASkinCountsAgainstTheLimitOfUnpackedBytes) {
  const SkinnedHills hills;
  PackedFile file;
  const int node = file.draco_node(hills.mesh, {}, hills.skin);
  const auto reads_within = [&](size_t bytes) {
    GltfLimits limits;
    limits.max_unpacked_bytes = bytes;
    return error_of(file.packed_glb(), limits).code == ErrorCode::kInternal;
  };
  size_t too_few = 0, enough = 1 << 20;
  while (enough - too_few > 1) {
    const size_t middle = (enough + too_few) / 2;
    (reads_within(middle) ? enough : too_few) = middle;
  }
  ASSERT_TRUE(reads_within(enough));
  hills.add_skin(file, node);
  EXPECT_FALSE(reads_within(enough)) << "the skin is unpacked too";
  EXPECT_TRUE(reads_within(enough + 36 * 32)) << "eight floats for each of 36 vertices";
}

TEST(Draco, AMeshWithoutJointsIsDrawnWithoutItsSkin) {
  const MeshData mesh = hills(4);
  PackedFile file;
  SkinnedHills::add_skin(file, file.draco_node(mesh, {}));
  const auto asset = load(file.packed_glb());
  EXPECT_EQ(triangles_of(*asset->meshes.at(1)), triangles_of(mesh));
  EXPECT_THAT(asset->warnings, testing::ElementsAre(HasSubstr("has no JOINTS_0")));
}

TEST(Draco, AnOlderBitStreamIsNotSupported) {
  PackedFile file;
  file.draco_node(hills(4), {});
  std::vector<std::byte> glb = file.packed_glb();
  const std::array<std::byte, 7> head = {std::byte{'D'}, std::byte{'R'}, std::byte{'A'}, std::byte{'C'},
                                         std::byte{'O'}, std::byte{2},   std::byte{2}};
  const auto found = std::search(glb.begin(), glb.end(), head.begin(), head.end());
  ASSERT_NE(found, glb.end());
  found[6] = std::byte{1};
  const Error error = error_of(glb);
  EXPECT_EQ(error.code, ErrorCode::kUnsupported);
  EXPECT_EQ(error.field, kDracoField);
}

TEST(Draco, EveryTruncationOfAStreamIsAnError) {
  for (const bool edgebreaker : {false, true}) {
    PackedFile file;
    file.draco_node(hills(6), {edgebreaker, 11});
    file.packed_glb();
    const auto whole = file.json["bufferViews"][0]["byteLength"].get<size_t>();
    for (size_t length = 1; length < whole; ++length) {
      file.json["bufferViews"][0]["byteLength"] = length;
      const Error error = error_of(file.glb());
      EXPECT_NE(error.code, ErrorCode::kInternal) << length << " of " << whole;
      EXPECT_THAT(error.field, StartsWith(kDracoField));
    }
  }
}

// The header of the connectivity states how many triangles follow. A stream of about a hundred bytes claims millions,
// and its accessors agree with it.
TEST(Draco, ClaimedSizesAreLimitedBeforeTheyAreBelieved) {
  PackedFile file;
  const MeshData mesh = hills(6);
  file.draco_node(mesh, {false, 11});
  file.packed_glb();
  std::vector<std::byte> claim = draco_stream(mesh, {false, 11});
  // After the header of 11 bytes: 72 triangles as one byte. 0x3FFFFFF of them as four.
  ASSERT_EQ(claim.at(11), std::byte{72});
  claim[11] = std::byte{0x1F};
  claim.insert(claim.begin() + 11, 3, std::byte{0xFF});
  const int view = file.view(claim);
  packing_of(file.json["meshes"][0]["primitives"][0])["bufferView"] = view;
  file.json["accessors"][1]["count"] = 120'000'000;
  const size_t before = peak_bytes();
  const Error error = error_of(file.packed_glb());
  EXPECT_EQ(error.code, ErrorCode::kResourceExhausted) << error.message;
  EXPECT_EQ(error.field, kDracoField);
  EXPECT_LT(peak_bytes() - before, size_t{64} << 20);
}

// Random changes of bytes in the binary chunk give an error that names a field, or some mesh; never a crash, and never
// much memory. Both structure and values are damaged, because the streams are short and every bit counts.
void damage_at_random(const std::vector<std::byte>& glb, size_t chunk_bytes, uint64_t seed, int rounds) {
  CounterRandom random(seed, 0, RandomPurpose::kTest);
  int refused = 0;
  for (int round = 0; round < rounds; ++round) {
    std::vector<std::byte> spoilt = glb;
    const int changes = 1 + static_cast<int>(4 * random.next_unit());
    for (int i = 0; i < changes; ++i) {
      const auto at = static_cast<size_t>(random.next_unit() * static_cast<double>(chunk_bytes));
      spoilt[glb.size() - chunk_bytes + at] = static_cast<std::byte>(256.0 * random.next_unit());
    }
    GeometryStore store;
    const auto asset = read_gltf(spoilt, nullptr, store);
    if (asset) continue;
    ++refused;
    EXPECT_NE(asset.error().code, ErrorCode::kInternal);
    EXPECT_FALSE(asset.error().field.empty()) << asset.error().message;
  }
  EXPECT_GT(refused, rounds / 100);
}

TEST(Packed, RandomDamageOfMeshoptStreamsIsSurvived) {
  PackedFile file;
  file.meshopt_node(hills(6), 2);
  const auto glb = file.packed_glb();
  const size_t before = peak_bytes();
  damage_at_random(glb, file.binary().size(), 1, 5000);
  EXPECT_LT(peak_bytes() - before, size_t{64} << 20);
}

TEST(Packed, RandomDamageOfDracoStreamsIsSurvived) {
  const size_t before = peak_bytes();
  for (const int bits : {0, 11})
    for (const bool edgebreaker : {false, true}) {
      PackedFile file;
      file.draco_node(hills(6), {edgebreaker, bits});
      const auto glb = file.packed_glb();
      damage_at_random(glb, file.binary().size(), static_cast<uint64_t>(2 + bits) + edgebreaker, 3000);
    }
  EXPECT_LT(peak_bytes() - before, size_t{64} << 20);
}

}  // namespace
}  // namespace sightline
