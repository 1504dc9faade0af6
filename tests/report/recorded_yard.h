// A recording with many events: a yard in the client's own shapes, made in this process without a daemon. Targets
// change, instances come, go, hide and move, ticks are refused and merged, and settings change. Any convention can be
// recorded.
#pragma once

#include <string>
#include <vector>

#include "client/recordings/local_session.h"
#include "client/recordings/writer.h"
#include "tests/recordings/string_sink.h"

namespace sightline::test {

struct RecordedYardOptions {
  v1::Convention::Preset convention = v1::Convention::PRESET_GLTF;
  int ticks = 150;              // at 60 Hz
  bool eventful = true;         // false: things only move
  bool candidates = false;      // whether every reply has its candidates
  bool finished = true;         // false: the file ends as after a kill
  uint64_t snapshot_ticks = 0;  // only stated in the file's info
  int points = 8;               // surface points of a target
  int memory_every = 0;         // 60: the server's memory after every 60th reply; 0: none
};

// The ticks at which the events of the yard happen.
inline constexpr int kYardRefused = 20, kYardCrateComes = 30, kYardFault = 40, kYardTargetsChange = 60, kYardGap = 70,
                     kYardPillarHides = 80, kYardCrateGoes = 90, kYardSettings = 95, kYardPillarShows = 110;
inline constexpr uint64_t kYardFirst = 10, kYardSecond = 11, kYardThird = 12, kYardPillar = 3, kYardCrate = 20;

struct RecordedYard {
  std::string bytes;  // of the file
  std::vector<v1::CameraReply> replies;
};

// Fails the test when anything fails.
RecordedYard record_yard(SamplerDevice& sampler, const RecordedYardOptions& options = {});

}  // namespace sightline::test
