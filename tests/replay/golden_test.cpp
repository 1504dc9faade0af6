// The golden recording, and the replies that it must always give. A change of one bit in a step fails this test. Then
// either the change is wrong, or the hashes below are updated on purpose.
//
// README.md beside this file defines "the same sampler". The hash was the same for every instruction set that Embree
// can choose, for the C library with and without fused multiply-adds, and for llvmpipe with 128 and 256 bits. So no
// decision in this session depends on a last bit. Other renderers skip the test: their maps may differ in texels
// through which a silhouette passes. make_golden writes the recording again, with replies of Embree.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "client/replay/compare_replies.h"
#include "server/gl/software_renderer.h"
#include "server/sample/sampler_choice.h"
#include "tests/replay/replayed.h"

namespace sightline {
namespace {

constexpr uint64_t kEmbreeHash = 0x7501bf4ea98ec958;
constexpr uint64_t kLlvmpipeHash = 0x7501bf4ea98ec958;

std::string golden_path() {
  return SIGHTLINE_SOURCE_DIR "/tests/replay/golden/hall.mcap";
}

const std::string& golden() {
  static const std::string bytes = [] {
    std::ifstream in(golden_path(), std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  }();
  return bytes;
}

test::Replayed replay_golden(std::unique_ptr<SamplerDevice> sampler) {
  const auto place = make_local_backend(std::move(sampler));
  return test::replay_on(*place, test::open_recording(golden()));
}

TEST(Golden, IsSmallAndWhole) {
  ASSERT_FALSE(golden().empty()) << golden_path();
  EXPECT_LT(golden().size(), 300'000u);
  const Recording recording = test::open_recording(golden());
  EXPECT_TRUE(recording.container().finished);
  EXPECT_EQ(recording.files()->size(), 1u);
}

TEST(Golden, EmbreeAnswersTheSameForEver) {
  const test::Replayed replayed = replay_golden(make_embree_sampler_device());
  EXPECT_EQ(replayed.verdict, ReplayVerdict::kEqual) << replayed.text;
  EXPECT_EQ(replayed.hash, kEmbreeHash) << std::hex << replayed.hash;
}

TEST(Golden, LlvmpipeAnswersTheSameForEver) {
  prepare_software_rendering();
  auto chosen = choose_sampler_device(SamplerChoice::kEgl, {});
  if (!chosen) GTEST_SKIP() << "no EGL context: " << to_string(chosen.error());
  if (chosen->device->renderer().find("llvmpipe") == std::string::npos)
    GTEST_SKIP() << "the hash is llvmpipe's, this is " << chosen->device->renderer();
  const test::Replayed replayed = replay_golden(std::move(chosen->device));
  EXPECT_EQ(replayed.hash, kLlvmpipeHash) << std::hex << replayed.hash << '\n' << replayed.text;
}

}  // namespace
}  // namespace sightline
