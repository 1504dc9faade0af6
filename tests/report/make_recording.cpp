// Makes the recordings that the page's test opens in a browser.
//   make_recording FOLDER           yard.mcap: see recorded_yard.h, in Unreal's convention; hall.mcap: the hall with
//   its scene
//                                   attached; lost.mcap: the same without the scene
//   make_recording FOLDER MINUTES   long.mcap: so many minutes in the yard, to measure the cost of a long report
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iostream>

#include "server/sample/embree_sampler.h"
#include "tests/replay/recorded_hall.h"
#include "tests/report/recorded_yard.h"

namespace {

void write(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) std::cerr << path << " cannot be written\n", std::exit(1);
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (argc != 2 && argc != 3) return 2;
  const std::filesystem::path folder(argv[1]);
  const auto sampler = sightline::make_embree_sampler_device();
  if (argc == 3) {
    const int ticks = 3600 * std::stoi(argv[2]);
    write(folder / "long.mcap", sightline::test::record_yard(*sampler, {.ticks = ticks}).bytes);
    return testing::Test::HasFailure() ? 1 : 0;
  }
  write(folder / "yard.mcap",
        sightline::test::record_yard(*sampler, {.convention = sightline::v1::Convention::PRESET_UNREAL}).bytes);
  write(folder / "hall.mcap", sightline::test::record_hall(*sampler, {.ticks = 300, .memory_every = 60}).bytes);
  write(folder / "lost.mcap", sightline::test::record_hall(*sampler, {.ticks = 60, .attach_scene = false}).bytes);
  return testing::Test::HasFailure() ? 1 : 0;
}
