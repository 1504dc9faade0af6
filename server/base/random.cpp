#include "server/base/random.h"

namespace sightline {

std::array<uint32_t, 4> philox4x32(std::array<uint32_t, 4> c, std::array<uint32_t, 2> k) {
  for (int round = 0; round < 10; ++round) {
    const uint64_t p0 = uint64_t{0xD2511F53} * c[0];
    const uint64_t p1 = uint64_t{0xCD9E8D57} * c[2];
    c = {static_cast<uint32_t>(p1 >> 32) ^ c[1] ^ k[0], static_cast<uint32_t>(p1),
         static_cast<uint32_t>(p0 >> 32) ^ c[3] ^ k[1], static_cast<uint32_t>(p0)};
    k[0] += 0x9E3779B9;
    k[1] += 0xBB67AE85;
  }
  return c;
}

CounterRandom::CounterRandom(uint64_t seed, uint64_t tick, RandomPurpose purpose)
    : counter_{0, static_cast<uint32_t>(purpose), static_cast<uint32_t>(tick), static_cast<uint32_t>(tick >> 32)},
      key_{static_cast<uint32_t>(seed), static_cast<uint32_t>(seed >> 32)} {}

uint32_t CounterRandom::next_u32() {
  if (used_ == 4) {
    block_ = philox4x32(counter_, key_);
    ++counter_[0];
    used_ = 0;
  }
  return block_[used_++];
}

float CounterRandom::next_unit() {
  return static_cast<float>(next_u32() >> 8) * 0x1p-24f;
}

double CounterRandom::next_in(double low, double high) {
  return low + (high - low) * (next_u32() * 0x1p-32);
}

uint32_t CounterRandom::next_below(uint32_t count) {
  return static_cast<uint32_t>((uint64_t{next_u32()} * count) >> 32);
}

}  // namespace sightline
