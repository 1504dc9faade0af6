// Counter-based random numbers: Philox4x32-10 (Salmon, Moraes, Dror & Shaw, "Parallel random numbers: as easy as
// 1, 2, 3", SC 2011). A number is a pure function of (seed, tick, purpose, index), so a replay draws the same ones
// with any number of threads and any order of calls.
#pragma once

#include <array>
#include <cstdint>

namespace sightline {

// The purpose of a stream of numbers; two purposes never share numbers. Replays depend on the values: append, never
// renumber.
enum class RandomPurpose : uint32_t {
  kTexelJitter = 1,
  kExtentPoints = 2,
  kViewpointSearch = 3,
  kViewBlend = 4,
  kTurn = 5,
  kSceneGeneration = 900,
  kTest = 1000
};

// One Philox4x32-10 block.
std::array<uint32_t, 4> philox4x32(std::array<uint32_t, 4> counter, std::array<uint32_t, 2> key);

// A stream of numbers for one (seed, tick, purpose). Cheap to make; copy it to fork it. Not thread-safe.
class CounterRandom {
 public:
  CounterRandom(uint64_t seed, uint64_t tick, RandomPurpose purpose);

  uint32_t next_u32();
  // Uniform in [0, 1), 24 bits.
  float next_unit();
  // Uniform in [low, high).
  double next_in(double low, double high);
  // Uniform in [0, count); count > 0. Bias below count / 2^32.
  uint32_t next_below(uint32_t count);

 private:
  std::array<uint32_t, 4> counter_;
  std::array<uint32_t, 2> key_;
  std::array<uint32_t, 4> block_{};
  unsigned used_ = 4;
};

}  // namespace sightline
