// Files of EXT_meshopt_compression are made from known meshes with the library's encoders, read back, and compared with
// the meshes. Then their streams and descriptions are spoilt in known ways.
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <cmath>

#include "tests/scene/packed_mesh.h"
#include "tests/scene/read_packed.h"
#include "tests/support/peak_memory.h"

namespace sightline {
namespace {

using nlohmann::json;

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

}  // namespace
}  // namespace sightline
