// Real game assets, where their folder is at hand: SIGHTLINE_ASSETS, else the one beside the checkout.
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "server/scene/gltf.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

fs::path assets_folder() {
  if (const char* named = std::getenv("SIGHTLINE_ASSETS")) return named;
  return fs::path(SIGHTLINE_SOURCE_DIR) / ".." / "shared" / "assets" / "kaykit-dungeon";
}

// A plain second reader for plain files: one binary chunk, float positions, indexed triangles.
struct PlainGlb {
  json document;
  std::string binary;

  explicit PlainGlb(const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    const uint32_t length = at<uint32_t>(bytes, 12);
    document = json::parse(bytes.substr(20, length));
    binary = bytes.substr(28 + length);
  }

  template <typename T>
  static T at(const std::string& bytes, size_t offset) {
    T value;
    std::memcpy(&value, bytes.data() + offset, sizeof value);
    return value;
  }
  size_t offset_of(const json& accessor, size_t element, size_t element_bytes) const {
    const json& view = document["bufferViews"][accessor["bufferView"].get<size_t>()];
    return view.value("byteOffset", size_t{0}) + accessor.value("byteOffset", size_t{0}) +
           element * view.value("byteStride", element_bytes);
  }
  size_t index(const json& accessor, size_t i) const {
    if (accessor["componentType"] == 5121) return at<uint8_t>(binary, offset_of(accessor, i, 1));
    if (accessor["componentType"] == 5123) return at<uint16_t>(binary, offset_of(accessor, i, 2));
    return at<uint32_t>(binary, offset_of(accessor, i, 4));
  }
  glm::dvec3 position(const json& accessor, size_t i) const {
    const size_t offset = offset_of(accessor, i, 12);
    return {at<float>(binary, offset), at<float>(binary, offset + 4), at<float>(binary, offset + 8)};
  }

  // Triangles of one primitive that have an area.
  size_t count(const json& primitive) const {
    const json& indices = document["accessors"][primitive["indices"].get<size_t>()];
    const json& positions = document["accessors"][primitive["attributes"]["POSITION"].get<size_t>()];
    size_t with_area = 0;
    for (size_t i = 0; i < indices["count"].get<size_t>(); i += 3) {
      const glm::dvec3 a = position(positions, index(indices, i)), b = position(positions, index(indices, i + 1)),
                       c = position(positions, index(indices, i + 2));
      if (glm::cross(b - a, c - a) != glm::dvec3(0.0)) ++with_area;
    }
    return with_area;
  }
  // As instanced, below one node.
  size_t count_below(size_t node) const {
    const json& n = document["nodes"][node];
    size_t sum = 0;
    if (n.contains("mesh"))
      for (const json& primitive : document["meshes"][n["mesh"].get<size_t>()]["primitives"]) sum += count(primitive);
    for (const json& child : n.value("children", json::array())) sum += count_below(child.get<size_t>());
    return sum;
  }
  size_t count_all() const {
    size_t sum = 0;
    for (const json& root : document["scenes"][document.value("scene", size_t{0})]["nodes"])
      sum += count_below(root.get<size_t>());
    return sum;
  }
};

TEST(GltfAssets, EveryFileLoadsWithTheTrianglesThatAPlainReaderCounts) {
  if (!fs::is_directory(assets_folder()))
    GTEST_SKIP() << "no assets at " << assets_folder() << "; set SIGHTLINE_ASSETS";
  GeometryStore store;
  size_t files = 0;
  for (const auto& entry : fs::directory_iterator(assets_folder())) {
    if (entry.path().extension() != ".glb") continue;
    ++files;
    const auto asset = read_gltf_file(entry.path().string(), store);
    ASSERT_TRUE(asset) << entry.path() << " " << to_string(asset.error());
    EXPECT_EQ((*asset)->triangle_count(), PlainGlb(entry.path()).count_all()) << entry.path();
  }
  EXPECT_GE(files, 40u);
}

}  // namespace
}  // namespace sightline
