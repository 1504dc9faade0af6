// Files as exporters really write them. What is unusual but harmless is read; where something is left out, a warning
// names it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/scene/gltf.h"
#include "tests/support/glb_builder.h"

namespace sightline {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

class Exported : public testing::Test {
 protected:
  Result<std::shared_ptr<const SceneAsset>> read(const std::vector<std::byte>& bytes) {
    return read_gltf(bytes, nullptr, store);
  }
  std::shared_ptr<const SceneAsset> load(const std::vector<std::byte>& bytes) {
    auto asset = read(bytes);
    if (asset) return *asset;
    ADD_FAILURE() << to_string(asset.error());
    return std::make_shared<SceneAsset>();
  }
  std::shared_ptr<const SceneAsset> load() { return load(file.glb()); }
  Error error() {
    const auto asset = read(file.glb());
    return asset ? Error{ErrorCode::kInternal, "", "was read without an error"} : asset.error();
  }
  // buffers[0] is the binary chunk, and the others are as given.
  void add_buffers(const std::vector<json>& others) {
    file.json["buffers"] = json::array({{{"byteLength", file.binary().size()}}});
    for (const json& other : others) file.add("buffers", other);
  }

  GeometryStore store;
  GlbBuilder file;
};

TEST_F(Exported, BuffersThatNothingUsesNeedNoBytes) {
  file.triangle_node();
  add_buffers({{{"byteLength", 1099511627776}},
               {{"byteLength", 8}, {"uri", "http://example.com/buffer.bin"}},
               {{"byteLength", 8}, {"uri", "missing.bin"}}});
  file.add("bufferViews", {{"buffer", 1}, {"byteLength", 4}});
  const auto asset = load();
  EXPECT_EQ(asset->triangle_count(), 1u);
  EXPECT_THAT(asset->warnings, ElementsAre(StartsWith("buffers[1].uri: is missing"), StartsWith("buffers[2].uri: "),
                                           AllOf(StartsWith("buffers[3].uri: "), HasSubstr("left out"))));
  file.json["bufferViews"][0]["buffer"] = 1;
  EXPECT_EQ(error().field, "buffers[1].uri");
  file.json["bufferViews"][0]["buffer"] = 2;
  EXPECT_EQ(error().field, "buffers[2].uri");
}

TEST_F(Exported, BuffersWithoutBytesAreLimited) {
  file.triangle_node();
  add_buffers(std::vector<json>(1000, {{"byteLength", 1}}));
  EXPECT_EQ(load()->triangle_count(), 1u);
  add_buffers(std::vector<json>(1001, {{"byteLength", 1}}));
  EXPECT_EQ(error().code, ErrorCode::kResourceExhausted);
  EXPECT_EQ(error().field, "buffers");
}

TEST_F(Exported, DataUrisMayHaveAnyMediaType) {
  file.triangle_node();
  const auto plain = file.gltf_with_data_uri();
  const std::string text(reinterpret_cast<const char*>(plain.data()), plain.size());
  const std::string usual = "data:application/octet-stream;base64,";
  for (const char* head :
       {"data:application/gltf-buffer;base64,", "data:;base64,", "data:model/vnd.x;charset=u;base64,"}) {
    std::string other = text;
    other.replace(other.find(usual), usual.size(), head);
    EXPECT_EQ(load(bytes_of(other))->triangle_count(), 1u) << head;
  }
  std::string escaped;
  for (const std::byte byte : file.binary()) {
    constexpr char kDigits[] = "0123456789abcdef";
    escaped += {'%', kDigits[std::to_integer<int>(byte) >> 4], kDigits[std::to_integer<int>(byte) & 15]};
  }
  EXPECT_EQ(load(file.gltf("data:application/gltf-buffer," + escaped))->triangle_count(), 1u);
  for (const char* uri : {"data:application/octet-stream;base64", "data:,%2", "data:;base64,%zz"}) {
    const auto asset = read(file.gltf(uri));
    ASSERT_FALSE(asset) << uri;
    EXPECT_EQ(asset.error().code, ErrorCode::kDataLoss) << uri;
    EXPECT_EQ(asset.error().field, "buffers[0].uri") << uri;
  }
}

// JSON has one kind of number.
TEST_F(Exported, WholeNumbersMayHaveAPoint) {
  const int node = file.triangle_node();
  file.json["accessors"][0]["count"] = 3.0;
  file.json["accessors"][0]["componentType"] = 5126.0;
  file.json["bufferViews"][0]["buffer"] = 0.0;
  file.json["bufferViews"][0]["byteLength"] = 36.0;
  file.json["meshes"][0]["primitives"][0]["mode"] = 4.0;
  file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 0.0;
  file.json["nodes"][node]["mesh"] = 0.0;
  file.json["nodes"][node]["extras"]["sightline"] = {{"layers", 6.0}, {"collides", 0.0}};
  file.json["nodes"].push_back({{"children", {0.0}}});
  file.json["scenes"] = json::array({{{"nodes", {1.0}}}});
  file.json["scene"] = 0.0;
  const auto asset = load();
  EXPECT_EQ(asset->triangle_count(), 1u);
  EXPECT_EQ(asset->nodes.at(1).attributes.layers, 6u);
  EXPECT_FALSE(asset->nodes.at(1).attributes.collides);
  for (const json& wrong : {json(0.5), json(-1.0), json(1e300)}) {
    file.json["nodes"][node]["mesh"] = wrong;
    EXPECT_EQ(error().field, "nodes[0].mesh") << wrong;
  }
}

TEST_F(Exported, ALaterVersionOfTheFormatIsReadAsTwo) {
  file.triangle_node();
  file.json["asset"] = {{"version", "2.1"}, {"minVersion", "2.1"}};
  const auto asset = load();
  EXPECT_EQ(asset->triangle_count(), 1u);
  EXPECT_THAT(asset->warnings, ElementsAre(StartsWith("asset.minVersion: is 2.1")));
  file.json["asset"]["minVersion"] = "2.0";
  EXPECT_THAT(load()->warnings, IsEmpty());
}

TEST_F(Exported, AnAccessorOfAnUnknownTypeMattersOnlyWhereItIsRead) {
  file.triangle_node();
  const int other = file.add("accessors", {{"count", 2}, {"componentType", 5126}, {"type", "VEC16"}});
  file.json["meshes"][0]["primitives"][0]["attributes"]["_OTHER"] = other;
  EXPECT_EQ(load()->triangle_count(), 1u);
  for (const char* use : {"POSITION", "indices"}) {
    GlbBuilder used = file;
    json& primitive = used.json["meshes"][0]["primitives"][0];
    (std::string(use) == "indices" ? primitive : primitive["attributes"])[use] = other;
    used.json["accessors"][other]["count"] = 3;
    const auto asset = read(used.glb());
    ASSERT_FALSE(asset) << use;
    EXPECT_EQ(asset.error().field, "accessors[1].type") << use;
  }
}

TEST_F(Exported, VerticesThatAreOverAreLeftOut) {
  file.triangle_node();
  json& primitive = file.json["meshes"][0]["primitives"][0];
  primitive["indices"] = file.accessor<uint8_t>({0, 1, 2, 2, 99}, "SCALAR", kUnsignedByte);
  auto asset = load();
  EXPECT_EQ(asset->triangle_count(), 1u);
  EXPECT_THAT(asset->warnings, ElementsAre(AllOf(StartsWith("meshes[0].primitives[0].indices: 5 vertices"),
                                                 HasSubstr("the incomplete one is left out"))));
  primitive.erase("indices");
  primitive["attributes"]["POSITION"] = file.floats({0, 0, 0, 1, 0, 0, 0, 1, 0, 9, 9, 9});
  asset = load();
  EXPECT_EQ(asset->triangle_count(), 1u);
  EXPECT_EQ(asset->meshes.at(0)->bounds.max.x, 1.0f) << "a vertex that was left out is nowhere";
  EXPECT_THAT(asset->warnings, ElementsAre(StartsWith("meshes[0].primitives[0].attributes.POSITION: 4 vertices")));
  primitive["attributes"]["POSITION"] = file.floats({0, 0, 0, 1, 0, 0});
  primitive["mode"] = 5;
  asset = load();
  EXPECT_EQ(asset->triangle_count(), 0u);
  EXPECT_THAT(asset->warnings, ElementsAre(HasSubstr("the incomplete one is left out")));
}

TEST_F(Exported, TheLastRowOfAMatrixMayBeRounded) {
  const int node = file.triangle_node();
  const auto with_last = [&](double value) {
    file.json["nodes"][node]["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4, 5, 6, value};
  };
  with_last(1.0000001);
  const auto asset = load();
  EXPECT_EQ(glm::dvec3(asset->nodes.at(0).parent_from_node[3]), glm::dvec3(4, 5, 6));
  EXPECT_THAT(asset->warnings, ElementsAre(StartsWith("nodes[0].matrix: its last row")));
  with_last(1.0);
  EXPECT_THAT(load()->warnings, IsEmpty());
  with_last(1.001);
  EXPECT_EQ(error().field, "nodes[0].matrix");
}

TEST_F(Exported, KeysWithoutDataAreLeftOut) {
  const int node = file.triangle_node();
  for (const char* member : {"input", "output"}) {
    GlbBuilder animated = file;
    animated.animation(node, "rotation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0, 0, 1});
    const int accessor = animated.json["animations"][0]["samplers"][0][member];
    animated.json["accessors"][accessor].erase("bufferView");
    const auto asset = load(animated.glb());
    ASSERT_EQ(asset->animations.size(), 1u);
    EXPECT_THAT(asset->animations[0].channels, IsEmpty()) << member;
    EXPECT_THAT(asset->warnings, ElementsAre(AllOf(StartsWith("animations[0].channels[0]: "), HasSubstr("no data"))));
  }
}

}  // namespace
}  // namespace sightline
