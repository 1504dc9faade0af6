// A recording of a camera in the hall, made in this process without a daemon.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/recordings/local_session.h"
#include "client/recordings/writer.h"

namespace sightline::test {

inline constexpr uint64_t kRecordedStartNs = 1'700'000'000'000'000'000;

struct RecordedHallOptions {
  int ticks = 60;  // at 60 Hz
  uint64_t seed = 1;
  int merge_every = 0;    // 2: every second tick is merged into the next; 0: none
  int quality_level = 0;  // of every step
  int memory_every = 0;   // 60: the server's memory after every 60th reply; 0: none
  bool attach_scene = true;
  std::function<std::vector<std::byte>(double duration_s)> scene = {};  // empty: the hall
  v1::Settings settings = {};
  tuning::v1alpha1::Tuning tuning = {};
  // Changes the opening, and tick i before it is applied and recorded, given the newest reply. A tick that is then
  // refused is recorded with its refusal, and gets no step.
  std::function<void(v1::OpenSession&)> change_open = {};
  std::function<void(int, const v1::CameraReply&, v1::Tick&)> change = {};
};

struct RecordedHall {
  std::string bytes;  // of the file
  uint64_t hash = 0;  // of all replies, chained
  size_t replies = 0;
};

// Fails the test when anything fails.
RecordedHall record_hall(SamplerDevice& sampler, const RecordedHallOptions& options = {});

}  // namespace sightline::test
