// Hostile files. The reader must answer with an Error that names the place, never crash, and use no more memory than
// the limits allow. Run under AddressSanitizer to give "no crash" its full meaning.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>

#include "server/base/random.h"
#include "server/scene/gltf.h"
#include "tests/support/glb_builder.h"
#include "tests/support/peak_memory.h"

namespace sightline {
namespace {

using nlohmann::json;
using testing::HasSubstr;

// A small file that uses most of what the reader knows.
GlbBuilder rich_file() {
  GlbBuilder file;
  const int node = file.triangle_node();
  const std::vector<uint16_t> sparse_index = {1};
  const std::vector<float> sparse_value = {2, 0, 0};
  file.json["accessors"][0]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", file.view(std::as_bytes(std::span(sparse_index)))}, {"componentType", 5123}}},
      {"values", {{"bufferView", file.view(std::as_bytes(std::span(sparse_value)))}}}};
  file.json["meshes"][0]["primitives"][0]["indices"] = file.accessor<uint8_t>({0, 1, 2}, "SCALAR", kUnsignedByte);
  file.add("materials", {{"alphaMode", "BLEND"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.2}}}}});
  file.json["meshes"][0]["primitives"][0]["material"] = 0;
  file.json["nodes"][node]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] = file.floats(
      {1, 2, 3, 4, 5, 6});
  file.json["nodes"][node]["extras"]["sightline"] = {{"layers", 1}, {"opacity", 0.9}};
  file.add("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.25}}}});
  file.add("nodes", {{"camera", 0}, {"children", {node}}, {"rotation", {0, 0, 0, 1}}});
  file.animation(1, "rotation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0, 1, 0});
  file.add("scenes", {{"nodes", {1}}});
  file.json["scene"] = 0;
  return file;
}

Error error_of(const std::vector<std::byte>& bytes, const GltfLimits& limits = {}) {
  GeometryStore store;
  const auto asset = read_gltf(bytes, nullptr, store, limits);
  if (asset) return {ErrorCode::kInternal, "", "was read without an error"};
  return asset.error();
}
Error error_of(const GlbBuilder& file, const GltfLimits& limits = {}) {
  return error_of(file.glb(), limits);
}

TEST(GltfHostile, TheRichFileIsSound) {
  GeometryStore store;
  const auto asset = read_gltf(rich_file().glb(), nullptr, store);
  ASSERT_TRUE(asset) << to_string(asset.error());
  EXPECT_EQ((*asset)->triangle_count(), 2u);
}

TEST(GltfHostile, EveryTruncationOfAGlbIsAnError) {
  const auto whole = rich_file().glb();
  for (size_t length = 0; length < whole.size(); ++length) {
    const std::vector<std::byte> part(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length));
    const Error error = error_of(part);
    EXPECT_NE(error.code, ErrorCode::kInternal) << length << " of " << whole.size();
    EXPECT_FALSE(error.field.empty());
  }
}

TEST(GltfHostile, EveryTruncationOfAGltfIsAnError) {
  const auto whole = rich_file().gltf_with_data_uri();
  for (size_t length = 0; length < whole.size(); ++length) {
    const std::vector<std::byte> part(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length));
    EXPECT_NE(error_of(part).code, ErrorCode::kInternal) << length << " of " << whole.size();
  }
}

// Rewrites the length in the header to match, so that the damage reaches what lies behind the header.
TEST(GltfHostile, ATruncatedBinaryChunkIsAnError) {
  const GlbBuilder file = rich_file();
  json document = file.json;
  document["buffers"] = json::array({{{"byteLength", file.binary().size()}}});
  for (size_t length = 0; length + 4 <= file.binary().size(); length += 4) {
    const auto binary = file.binary().first(length);
    EXPECT_NE(error_of(make_glb(document.dump(), {binary.begin(), binary.end()})).code, ErrorCode::kInternal) << length;
  }
}

// For any damage, the reader answers with an asset or an Error and keeps within its memory.
TEST(GltfHostile, RandomByteDamageNeverCrashes) {
  const auto whole = rich_file().glb();
  CounterRandom random(7, 0, RandomPurpose::kTest);
  const size_t before = peak_bytes();
  size_t read = 0;
  for (int round = 0; round < 20'000; ++round) {
    auto damaged = whole;
    const uint32_t count = 1 + random.next_below(4);
    for (uint32_t i = 0; i < count; ++i)
      damaged[random.next_below(static_cast<uint32_t>(damaged.size()))] = static_cast<std::byte>(
          random.next_below(256));
    GeometryStore store;
    if (const auto asset = read_gltf(damaged, nullptr, store)) {
      ++read;
      for (const AssetAnimation& animation : (*asset)->animations) animated_world_from_node(**asset, animation, 0.5);
    }
  }
  EXPECT_GT(read, 0u);
  EXPECT_LT(read, 20'000u);
  EXPECT_LT(peak_bytes() - before, size_t{256} << 20);
}

// Replaces digits by digits and keys by keys. Damage that keeps the JSON well formed reaches deeper than random bytes.
TEST(GltfHostile, RandomNumbersInWellFormedJsonNeverCrash) {
  const GlbBuilder file = rich_file();
  CounterRandom random(8, 0, RandomPurpose::kTest);
  const std::vector<json> values = {
      -1,  0,    1,    2,    3,    7,  255,    65535,    2147483647, 4294967295u, 1099511627776, 1e300,         -1e300,
      0.5, 5120, 5121, 5125, 5126, "", "VEC4", "SCALAR", nullptr,    true,        json::array(), json::object()};
  json document = file.json;
  document["buffers"] = json::array({{{"byteLength", file.binary().size()}}});
  const json flat = document.flatten();
  std::vector<std::string> paths;
  for (const auto& item : flat.items()) paths.push_back(item.key());
  const std::vector<std::byte> binary(file.binary().begin(), file.binary().end());
  const size_t before = peak_bytes();
  for (int round = 0; round < 10'000; ++round) {
    json damaged = document;
    const uint32_t count = 1 + random.next_below(2);
    for (uint32_t i = 0; i < count; ++i) try {
        damaged[json::json_pointer(paths[random.next_below(static_cast<uint32_t>(paths.size()))])] =
            values[random.next_below(static_cast<uint32_t>(values.size()))];
      } catch (const json::exception&) {  // the first damage removed the place of the second
      }
    GeometryStore store;
    const auto asset = read_gltf(make_glb(damaged.dump(), binary), nullptr, store);
    EXPECT_TRUE(asset || !asset.error().message.empty());
  }
  EXPECT_LT(peak_bytes() - before, size_t{256} << 20);
}

struct Hostile {
  const char* name;
  std::function<void(GlbBuilder&)> spoil;
  ErrorCode code;
  const char* field;
};

void PrintTo(const Hostile& hostile, std::ostream* out) {
  *out << hostile.name;
}

class GltfHostileFile : public testing::TestWithParam<Hostile> {};

TEST_P(GltfHostileFile, IsRefusedByName) {
  GlbBuilder file = rich_file();
  GetParam().spoil(file);
  const size_t before = peak_bytes();
  const Error error = error_of(file);
  EXPECT_EQ(to_string(error.code), to_string(GetParam().code)) << to_string(error);
  EXPECT_EQ(error.field, GetParam().field) << error.message;
  EXPECT_LT(peak_bytes() - before, size_t{64} << 20);
}

constexpr ErrorCode kInvalid = ErrorCode::kInvalidArgument;
constexpr ErrorCode kLoss = ErrorCode::kDataLoss;
constexpr ErrorCode kTooMuch = ErrorCode::kResourceExhausted;

json& accessor0(GlbBuilder& f) {
  return f.json["accessors"][0];
}
json& primitive0(GlbBuilder& f) {
  return f.json["meshes"][0]["primitives"][0];
}

const Hostile kHostile[] = {
    {"NoAsset", [](auto& f) { f.json.erase("asset"); }, kInvalid, "asset"},
    {"OldVersion", [](auto& f) { f.json["asset"]["version"] = "1.0"; }, ErrorCode::kUnsupported, "asset.version"},
    {"NewMinVersion", [](auto& f) { f.json["asset"]["minVersion"] = "3.0"; }, ErrorCode::kUnsupported,
     "asset.minVersion"},
    {"NodesNotAnArray", [](auto& f) { f.json["nodes"] = 3; }, kInvalid, "nodes"},
    {"NodeNotAnObject", [](auto& f) { f.json["nodes"][1] = 3; }, kInvalid, "nodes[1]"},
    {"SelfCycle", [](auto& f) { f.json["nodes"][0]["children"] = {0}; }, kInvalid, "nodes[1].children"},
    {"CycleBesideTheScene",
     [](auto& f) {
       f.add("nodes", {{"children", {3}}});
       f.add("nodes", {{"children", {2}}});
     },
     kInvalid, "nodes[2]"},
    {"TwoParents",
     [](auto& f) {
       f.add("nodes", {{"children", {0}}});
     },
     kInvalid, "nodes[2].children"},
    {"SameChildTwice",
     [](auto& f) {
       f.json["nodes"][1]["children"] = {0, 0};
     },
     kInvalid, "nodes[1].children"},
    {"SceneRootIsAChild", [](auto& f) { f.json["scenes"][0]["nodes"] = {0}; }, kInvalid, "scenes[0].nodes"},
    {"SceneRootTwice",
     [](auto& f) {
       f.json["scenes"][0]["nodes"] = {1, 1};
     },
     kInvalid, "scenes[0].nodes"},
    {"TooDeep",
     [](auto& f) {
       for (int i = 0; i < 70; ++i) f.add("nodes", {{"children", {f.json["nodes"].size() + 1}}});
       f.add("nodes", json::object());
     },
     kTooMuch, "nodes[66]"},
    {"ChildOutOfRange", [](auto& f) { f.json["nodes"][1]["children"] = {9}; }, kInvalid, "nodes[1].children[0]"},
    {"NegativeChild", [](auto& f) { f.json["nodes"][1]["children"] = {-1}; }, kInvalid, "nodes[1].children[0]"},
    {"ChildWrapsAround", [](auto& f) { f.json["nodes"][1]["children"] = {4294967296}; }, kInvalid,
     "nodes[1].children[0]"},
    {"MeshOutOfRange", [](auto& f) { f.json["nodes"][0]["mesh"] = 1; }, kInvalid, "nodes[0].mesh"},
    {"MeshIsAString", [](auto& f) { f.json["nodes"][0]["mesh"] = "0"; }, kInvalid, "nodes[0].mesh"},
    {"CameraOutOfRange", [](auto& f) { f.json["nodes"][1]["camera"] = 1; }, kInvalid, "nodes[1].camera"},
    {"SceneOutOfRange", [](auto& f) { f.json["scene"] = 1; }, kInvalid, "scene"},
    {"ZeroRotation",
     [](auto& f) {
       f.json["nodes"][1]["rotation"] = {0, 0, 0, 0};
     },
     kInvalid, "nodes[1].rotation"},
    {"ShortRotation",
     [](auto& f) {
       f.json["nodes"][1]["rotation"] = {0, 0, 1};
     },
     kInvalid, "nodes[1].rotation"},
    {"WordInTranslation",
     [](auto& f) {
       f.json["nodes"][1]["translation"] = {0, "x", 1};
     },
     kInvalid, "nodes[1].translation[1]"},
    {"ScaleOverflowsDownTheHierarchy",
     [](auto& f) {
       f.json["nodes"][1]["scale"] = {1e200, 1, 1};
       f.json["nodes"][0]["scale"] = {1e200, 1, 1};
     },
     kInvalid, "nodes[0]"},
    {"ProjectiveMatrix",
     [](auto& f) { f.json["nodes"][0]["matrix"] = {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}; }, kInvalid,
     "nodes[0].matrix"},
    {"ViewBeyondBuffer", [](auto& f) { f.json["bufferViews"][0]["byteLength"] = 100000; }, kLoss, "bufferViews[0]"},
    {"ViewOffsetBeyondBuffer", [](auto& f) { f.json["bufferViews"][0]["byteOffset"] = 1099511627776; }, kLoss,
     "bufferViews[0]"},
    {"ViewOffsetNearTheLargestNumber", [](auto& f) { f.json["bufferViews"][0]["byteOffset"] = UINT64_MAX - 8; },
     kInvalid, "bufferViews[0].byteOffset"},
    {"ViewOfNoBuffer", [](auto& f) { f.json["bufferViews"][0]["buffer"] = 1; }, kInvalid, "bufferViews[0].buffer"},
    {"OddStride", [](auto& f) { f.json["bufferViews"][0]["byteStride"] = 13; }, kInvalid, "bufferViews[0].byteStride"},
    {"StrideBelowElement", [](auto& f) { f.json["bufferViews"][0]["byteStride"] = 4; }, kInvalid, "accessors[0]"},
    {"HugeStride", [](auto& f) { f.json["bufferViews"][0]["byteStride"] = 256; }, kInvalid,
     "bufferViews[0].byteStride"},
    {"StrideReachesBeyondView", [](auto& f) { f.json["bufferViews"][0]["byteStride"] = 16; }, kLoss, "accessors[0]"},
    {"AccessorBeyondView",
     [](auto& f) {
       accessor0(f)["count"] = 6;
       primitive0(f).erase("indices");
     },
     kLoss, "accessors[0]"},
    {"AccessorOffsetBeyondView", [](auto& f) { accessor0(f)["byteOffset"] = 1099511627776; }, kLoss, "accessors[0]"},
    {"ZeroCount", [](auto& f) { accessor0(f)["count"] = 0; }, kInvalid, "accessors[0].count"},
    {"NegativeCount", [](auto& f) { accessor0(f)["count"] = -3; }, kInvalid, "accessors[0].count"},
    {"FractionalCount", [](auto& f) { accessor0(f)["count"] = 3.5; }, kInvalid, "accessors[0].count"},
    {"CountOfBillions", [](auto& f) { accessor0(f)["count"] = 4000000000u; }, kInvalid, "accessors[0].count"},
    {"CountNearTwoBillion",
     [](auto& f) {
       accessor0(f)["count"] = 2147483646;
       primitive0(f).erase("indices");
     },
     kTooMuch, "meshes[0].primitives[0]"},
    {"SparseOverNothingOfMillions",
     [](auto& f) {
       accessor0(f).erase("bufferView");
       accessor0(f)["count"] = 120'000'000;
     },
     kTooMuch, "accessors[0].count"},
    {"SparseCountAboveCount", [](auto& f) { accessor0(f)["sparse"]["count"] = 4; }, kInvalid,
     "accessors[0].sparse.count"},
    {"SparseCountOfMillions", [](auto& f) { accessor0(f)["sparse"]["count"] = 2147483647; }, kInvalid,
     "accessors[0].sparse.count"},
    {"SparseIndicesMissing", [](auto& f) { accessor0(f)["sparse"].erase("indices"); }, kInvalid,
     "accessors[0].sparse.indices"},
    {"SparseIndicesOfFloats", [](auto& f) { accessor0(f)["sparse"]["indices"]["componentType"] = 5126; }, kInvalid,
     "accessors[0].sparse.indices.componentType"},
    {"SparseIndicesBeyondView", [](auto& f) { accessor0(f)["sparse"]["indices"]["byteOffset"] = 2; }, kLoss,
     "accessors[0].sparse.indices"},
    {"SparseValuesBeyondView", [](auto& f) { accessor0(f)["sparse"]["values"]["byteOffset"] = 4; }, kLoss,
     "accessors[0].sparse.values"},
    {"PositionsOfTwoNumbers", [](auto& f) { accessor0(f)["type"] = "VEC2"; }, kInvalid,
     "meshes[0].primitives[0].attributes.POSITION"},
    {"PositionsOfUnsignedInts", [](auto& f) { accessor0(f)["componentType"] = 5125; }, kInvalid,
     "meshes[0].primitives[0].attributes.POSITION"},
    {"UnknownComponentType", [](auto& f) { accessor0(f)["componentType"] = 5124; }, kInvalid,
     "accessors[0].componentType"},
    {"DoubleComponentType", [](auto& f) { accessor0(f)["componentType"] = 5130; }, kInvalid,
     "accessors[0].componentType"},
    {"UnknownType", [](auto& f) { accessor0(f)["type"] = "VEC9"; }, kInvalid, "accessors[0].type"},
    {"IndicesOfFloats", [](auto& f) { primitive0(f)["indices"] = 0; }, kInvalid, "meshes[0].primitives[0].indices"},
    {"AttributeOutOfRange", [](auto& f) { primitive0(f)["attributes"]["POSITION"] = 99; }, kInvalid,
     "meshes[0].primitives[0].attributes.POSITION"},
    {"UnknownMode", [](auto& f) { primitive0(f)["mode"] = 7; }, kInvalid, "meshes[0].primitives[0].mode"},
    {"IndexOutOfRange",
     [](auto& f) {
       primitive0(f)["indices"] = f.template accessor<uint8_t>({0, 1, 3}, "SCALAR", kUnsignedByte);
     },
     kInvalid, "meshes[0].primitives[0].indices[2]"},
    {"RestartIndex",
     [](auto& f) {
       primitive0(f)["indices"] = f.template accessor<uint8_t>({0, 255, 2}, "SCALAR", kUnsignedByte);
     },
     kInvalid, "meshes[0].primitives[0].indices[1]"},
    {"NanPosition",
     [](auto& f) {
       primitive0(f)["attributes"]["POSITION"] = f.floats({0, 0, 0, 1, std::nanf(""), 0, 0, 1, 0});
     },
     kInvalid, "meshes[0].primitives[0].attributes.POSITION[1]"},
    {"InfinitePosition",
     [](auto& f) {
       primitive0(f)["attributes"]["POSITION"] = f.floats({0, 0, 0, 1, 0, 0, 0, 1, -INFINITY});
     },
     kInvalid, "meshes[0].primitives[0].attributes.POSITION[2]"},
    {"EnormousPosition",
     [](auto& f) {
       primitive0(f)["attributes"]["POSITION"] = f.floats({3e38f, 0, 0, 1, 0, 0, 0, 1, 0});
     },
     kInvalid, "meshes[0].primitives[0].attributes.POSITION[0]"},
    {"NanInstance",
     [](auto& f) {
       f.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] = f.floats(
           {0, 0, std::nanf("")});
     },
     kInvalid, "nodes[0]"},
    {"InstanceAttributeOutOfRange",
     [](auto& f) { f.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] = 77; }, kInvalid,
     "nodes[0].extensions.EXT_mesh_gpu_instancing.attributes.SCALE"},
    {"ZeroFieldOfView", [](auto& f) { f.json["cameras"][0]["perspective"]["yfov"] = 0; }, kInvalid,
     "cameras[0].perspective.yfov"},
    {"CameraOfUnknownType", [](auto& f) { f.json["cameras"][0]["type"] = "fisheye"; }, kInvalid, "cameras[0].type"},
    {"SamplerOutOfRange", [](auto& f) { f.json["animations"][0]["channels"][0]["sampler"] = 1; }, kInvalid,
     "animations[0].channels[0].sampler"},
    {"AnimatedNodeOutOfRange", [](auto& f) { f.json["animations"][0]["channels"][0]["target"]["node"] = 5; }, kInvalid,
     "animations[0].channels[0].target.node"},
    {"NoSamplers", [](auto& f) { f.json["animations"][0].erase("samplers"); }, kInvalid, "animations[0].samplers"},
    {"BufferBeyondChunk", [](auto& f) { f.json["buffers"][0]["byteLength"] = 100000; }, kLoss, "buffers[0]"},
    {"BufferOfTerabytes", [](auto& f) { f.json["buffers"][0]["byteLength"] = 1099511627776; }, kTooMuch,
     "buffers[0].byteLength"},
    {"BufferOfNothing", [](auto& f) { f.json["buffers"][0]["byteLength"] = 0; }, kInvalid, "buffers[0].byteLength"},
    {"SecondBufferWithoutUri",
     [](auto& f) {
       f.json["buffers"] = json::array({{{"byteLength", f.binary().size()}}, {{"byteLength", 36}}});
       f.json["bufferViews"][0]["buffer"] = 1;
     },
     kInvalid, "buffers[1].uri"},
    {"FileWhereNoneIsAllowed",
     [](auto& f) {
       f.json["buffers"][0] = {{"byteLength", 4}, {"uri", "a.bin"}};
     },
     kInvalid, "buffers[0].uri"},
    {"BrokenDataUri",
     [](auto& f) {
       f.json["buffers"][0] = {{"byteLength", 4}, {"uri", "data:application/octet-stream;base64,!!!!"}};
     },
     kLoss, "buffers[0].uri"},
};

INSTANTIATE_TEST_SUITE_P(All, GltfHostileFile, testing::ValuesIn(kHostile),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(GltfHostile, DeepJsonIsRefusedBeforeItIsParsed) {
  for (const char* open : {"[", "{\"a\":"}) {
    std::string text;
    for (int i = 0; i < 1'000'000; ++i) text += open;
    const Error error = error_of(make_glb(text, {}));
    EXPECT_EQ(error.code, ErrorCode::kResourceExhausted);
    EXPECT_EQ(error.field, "json");
  }
}

TEST(GltfHostile, ManyJsonValuesAreRefusedBeforeAnyIsStored) {
  GltfLimits limits;
  limits.max_json_values = 1000;
  std::string text = "{\"asset\":{\"version\":\"2.0\"},\"extras\":[";
  for (int i = 0; i < 2000; ++i) text += "0,";
  EXPECT_EQ(error_of(bytes_of(text + "0]}"), limits).code, ErrorCode::kResourceExhausted);
}

// Ten thousand primitives over the same corners: a small file that costs much work.
TEST(GltfHostile, SharedAccessorsCountEveryTimeTheyAreUsed) {
  GlbBuilder file;
  file.triangle_node();
  for (int i = 0; i < 10'000; ++i) file.json["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", 0}}}});
  GltfLimits limits;
  limits.max_triangles = 5'000;
  const Error error = error_of(file, limits);
  EXPECT_EQ(error.code, ErrorCode::kResourceExhausted);
  EXPECT_EQ(error.field, "meshes[0].primitives[5000]");
}

TEST(GltfHostile, InstancesAreCountedBeforeTheyAreMade) {
  GlbBuilder file = rich_file();
  GltfLimits limits;
  limits.max_instances = 1;
  EXPECT_EQ(error_of(file, limits).field, "nodes[0].extensions.EXT_mesh_gpu_instancing");
  const int scale = file.accessor_over(-1, 2'000'000'000, "VEC3", kFloat);
  file.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"SCALE", scale}};
  EXPECT_EQ(error_of(file).code, ErrorCode::kResourceExhausted);
}

TEST(GltfHostile, NodesAndAnimationValuesHaveCeilings) {
  GltfLimits limits;
  limits.max_nodes = 1;
  EXPECT_EQ(error_of(rich_file(), limits).field, "nodes");
  limits = {};
  limits.max_animation_values = 9;  // 2 keys of 1 + 4 numbers need 10
  EXPECT_EQ(error_of(rich_file(), limits).field, "animations[0].samplers[0]");
}

TEST(GltfHostile, AFileAboveTheLimitIsNotLookedAt) {
  GltfLimits limits;
  limits.max_file_bytes = 100;
  EXPECT_EQ(error_of(rich_file(), limits).code, ErrorCode::kResourceExhausted);
}

// Reading is ended at its first look at the clock, then at its second, and so on, until it is read. Nothing is left
// behind.
TEST(GltfHostile, ReadingEndsAtAnyMoment) {
  GlbBuilder file = rich_file();
  file.triangle_node();
  std::vector<float> many;
  for (int i = 0; i < 9 * 5000; ++i) many.push_back(static_cast<float>(i * 7919 % 1000));
  file.json["meshes"].back()["primitives"][0]["attributes"]["POSITION"] = file.floats(many);
  for (int i = 0; i < 20'000; ++i) file.json["extras"].push_back(json::object());
  const auto bytes = file.glb();
  std::atomic<int> looks{0};  // meshes are built on several threads
  int ended = 0;
  for (int most = 0; looks >= most; ++most) {
    looks = 0;
    GeometryStore store(size_t{1} << 30);
    WorkLimit work({.clock = [] { return int64_t{0}; }}, [&] { return ++looks > most; });
    GltfLimits limits;
    limits.work = &work;
    const auto asset = read_gltf(bytes, nullptr, store, limits);
    EXPECT_EQ(asset.has_value(), looks <= most);
    if (asset) continue;
    ++ended;
    EXPECT_EQ(asset.error().code, ErrorCode::kUnavailable) << to_string(asset.error());
    EXPECT_EQ(store.live_bytes(), 0u);
    EXPECT_EQ(store.reserved_bytes(), 0u);
  }
  EXPECT_GT(ended, 5) << "the stages look rarely";
}

TEST(GltfHostile, ReadingThatTakesTooLongNamesItsFlag) {
  WorkLimit work({.clock =
                      [] {
                        static int64_t now_ns = 0;
                        return now_ns += 1000;
                      },
                  .most_ns = 1,
                  .refusal = "takes too long (--max-load-s)"});
  GltfLimits limits;
  limits.work = &work;
  limits.memory_flag = "--geometry-memory-mib";
  const Error error = error_of(rich_file(), limits);
  EXPECT_EQ(error.code, ErrorCode::kResourceExhausted);
  EXPECT_EQ(error.message, "takes too long (--max-load-s)");
}

TEST(GltfHostile, AMemberThatStandsTwiceCountsAsItStandsLast) {
  const std::string text =
      R"({"asset": {"version": "2.0"}, "nodes": [{"name": "first"}], "nodes": [{"name": "a", "name": "last"}, {}]})";
  GeometryStore store;
  const auto asset = read_gltf(std::as_bytes(std::span(text)), nullptr, store);
  ASSERT_TRUE(asset) << to_string(asset.error());
  ASSERT_EQ((*asset)->nodes.size(), 2u);
  EXPECT_EQ((*asset)->nodes[0].name, "last");
}

TEST(GltfHostile, WarningsAreBounded) {
  GlbBuilder file;
  for (int i = 0; i < 500; ++i)
    file.add("meshes", {{"primitives", nlohmann::json::array({{{"attributes", nlohmann::json::object()}}})}});
  GeometryStore store;
  const auto asset = read_gltf(file.glb(), nullptr, store);
  ASSERT_TRUE(asset);
  EXPECT_EQ((*asset)->warnings.size(), 101u);
}

// "asked" stays empty, because a URI that leads outside the folder never reaches the callback.
TEST(GltfHostile, UrisThatLeaveTheFolderAreRefusedBeforeAnyFileIsAsked) {
  const std::string nul("a%00.bin");
  for (const std::string& uri :
       {std::string("../a.bin"), std::string("x/../../a.bin"), std::string(".."), std::string("x/.."),
        std::string("%2e%2e/a.bin"), std::string("%2E%2E%2Fa.bin"), std::string(".%2e/a.bin"),
        std::string("/etc/passwd"), std::string("%2Fetc/passwd"), std::string("file:///etc/passwd"),
        std::string("http://example.org/a.bin"), std::string("C:%5Ca.bin"), std::string("..\\a.bin"),
        std::string("a%0a.bin"), nul, std::string("a%2"), std::string("a%zz"), std::string("")}) {
    GlbBuilder file;
    file.triangle_node();
    std::string asked;
    GeometryStore store;
    const auto asset = read_gltf(
        file.gltf(uri),
        [&](const std::string& path) -> Result<std::vector<std::byte>> {
          asked = path;
          return std::vector<std::byte>(36);
        },
        store);
    ASSERT_FALSE(asset) << uri;
    EXPECT_EQ(asset.error().field, "buffers[0].uri") << uri;
    EXPECT_EQ(asset.error().code, ErrorCode::kInvalidArgument) << uri;
    EXPECT_EQ(asked, "") << uri;
  }
}

TEST(GltfHostile, DotsInsideANameAreOnlyDots) {
  GlbBuilder file;
  file.triangle_node();
  GeometryStore store;
  for (const char* uri : {"..a.bin", "a..b/c...bin", "./a.bin"}) {
    const auto asset = read_gltf(
        file.gltf(uri),
        [&](const std::string&) -> Result<std::vector<std::byte>> {
          return std::vector<std::byte>(file.binary().begin(), file.binary().end());
        },
        store);
    EXPECT_TRUE(asset) << uri;
  }
}

TEST(GltfHostile, ChunksOfAGlbAreChecked) {
  const auto sound = rich_file().glb();
  const auto with_u32 = [&](size_t offset, uint32_t value) {
    auto bytes = sound;
    std::memcpy(bytes.data() + offset, &value, sizeof value);
    return error_of(bytes);
  };
  EXPECT_EQ(with_u32(4, 1).field, "glb.header.version");
  EXPECT_EQ(with_u32(8, 0).field, "glb.header.length");
  EXPECT_EQ(with_u32(8, UINT32_MAX).field, "glb.header.length");
  EXPECT_EQ(with_u32(12, UINT32_MAX).field, "glb.chunks[0]");
  EXPECT_EQ(with_u32(12, UINT32_MAX - 7).field, "glb.chunks[0]");
  EXPECT_EQ(with_u32(16, 0x004E4942).field, "glb.chunks[0]");
  EXPECT_EQ(error_of(bytes_of("glTF")).field, "glb.header");
  EXPECT_EQ(error_of(std::vector<std::byte>()).field, "json");
}

}  // namespace
}  // namespace sightline
