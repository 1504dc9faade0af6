// What holds for packed files of both kinds: a limit on what they unpack to, what the command says of them, and damage
// at random. Run under AddressSanitizer to give "no crash" its full meaning.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "client/command/scene_command.h"
#include "server/base/random.h"
#include "tests/scene/packed_mesh.h"
#include "tests/scene/read_packed.h"
#include "tests/support/peak_memory.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using testing::HasSubstr;

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
