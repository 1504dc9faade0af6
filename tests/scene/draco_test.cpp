// Files of KHR_draco_mesh_compression are made from known meshes with the library's encoder, read back, and compared
// with the meshes. Then their streams and descriptions are spoilt in known ways.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <functional>

#include "tests/scene/packed_mesh.h"
#include "tests/scene/read_packed.h"
#include "tests/support/peak_memory.h"

namespace sightline {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::StartsWith;

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

}  // namespace
}  // namespace sightline
