// make_golden FILE: writes the recording that golden_test uses (tests/replay/golden/hall.mcap), with replies of Embree.
// It prints the hash of the replies, which golden_test.cpp pins.
#include <gtest/gtest.h>

#include <cinttypes>
#include <cstdio>
#include <fstream>

#include "server/sample/embree_sampler.h"
#include "tests/replay/recorded_hall.h"

namespace sightline {
namespace {

// Turns, occasional merged ticks, a cut, changed settings and a lower speed: everything that a tick can change in a
// step.
test::RecordedHallOptions golden_options() {
  test::RecordedHallOptions options{.ticks = 120, .merge_every = 7};
  options.tuning.mutable_sample()->set_points(2);
  options.change = [](int i, const v1::CameraReply&, v1::Tick& tick) {
    if (i == 40) {
      tick.mutable_observed_camera()->mutable_pose()->mutable_position()->set_y(3.0);
      tick.mutable_observed_camera()->mutable_pose()->mutable_rotation()->set_w(1.0);
      tick.mutable_observed_camera()->set_cut(true);
    }
    if (i == 60)
      tick.mutable_tuning()->mutable_aggregate()->mutable_filter()->set_mode(tuning::v1alpha1::FILTER_MODE_JOINT);
    if (i == 80) tick.mutable_limits()->set_max_speed_mps(2.0);
    if (i == 100) tick.mutable_settings()->set_preset(v1::Settings::PRESET_PAPER);
  };
  return options;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (argc != 2 || argv[1][0] == '-') {
    std::fprintf(stderr, "Usage: make_golden FILE\n");
    return 2;
  }
  const auto sampler = sightline::make_embree_sampler_device();
  const auto hall = sightline::test::record_hall(*sampler, sightline::golden_options());
  if (testing::Test::HasFailure()) return 1;
  std::ofstream file(argv[1], std::ios::binary);
  if (!(file << hall.bytes).flush()) {
    std::fprintf(stderr, "%s cannot be written\n", argv[1]);
    return 1;
  }
  std::printf("0x%016" PRIx64 ", %zu replies, %zu bytes\n", hall.hash, hall.replies, hall.bytes.size());
  return 0;
}
