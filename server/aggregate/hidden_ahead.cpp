#include "server/aggregate/hidden_ahead.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

// A slice is past when it is nearer than this, so that rounding never leaves a slice at the present itself.
constexpr double kPastS = 1e-6;

}  // namespace

HiddenAhead::Passing HiddenAhead::passing(double dt_s) const {
  double next_s = next_s_ - dt_s;
  size_t count = 0;
  for (; next_s < kPastS; next_s += kSliceS) ++count;
  return {count, next_s};
}

InlineVector<DueSlice, kSlices> HiddenAhead::due(double dt_s, size_t count) const {
  const Passing passed = passing(dt_s);
  // Slices that have passed come back at the end, never renewed.
  const auto renewed = [&](size_t slice) {
    return slice + passed.count < kSlices ? at(slice + passed.count).renewed : 0;
  };
  InlineVector<DueSlice, kSlices> due;
  for (size_t slice = 0; slice < kSlices; ++slice)
    due.push_back({slice, passed.next_s + kSliceS * static_cast<double>(slice)});
  std::sort(due.begin(), due.end(), [&](const DueSlice& a, const DueSlice& b) {
    return std::pair(renewed(a.slice), a.slice) < std::pair(renewed(b.slice), b.slice);
  });
  due.resize(std::min(count, kSlices));
  return due;
}

void HiddenAhead::advance(const Lattice& lattice, double dt_s) {
  const Passing passed = passing(dt_s);
  for (size_t k = 0; k < std::min(passed.count, kSlices); ++k) {
    Slice& slice = at(0);
    slice.renewed = 0;
    std::fill(slice.shares.begin(), slice.shares.end(), kUnknownShare);
    first_ = (first_ + 1) % kSlices;
  }
  next_s_ = passed.next_s;
  ++steps_;
  for (Slice& slice : slices_)
    if (slice.shares.size() != lattice.address_count()) slice.shares.assign(lattice.address_count(), kUnknownShare);
  uint64_t newest = newest_owner_;
  for (const uint32_t address : lattice.addresses()) {
    if (lattice.owner(address) <= newest_owner_) continue;
    newest = std::max(newest, lattice.owner(address));
    for (Slice& slice : slices_) slice.shares[address] = kUnknownShare;
  }
  newest_owner_ = newest;
}

void HiddenAhead::renew(size_t slice, const Lattice& lattice, std::span<const float> shares, double weight) {
  Slice& renewed = at(slice);
  renewed.renewed = steps_;
  const auto part = static_cast<float>(weight);
  for (size_t i = 0; i < shares.size(); ++i) {
    SharePart& share = renewed.shares[lattice.addresses()[i]];
    const float fresh = shares[i] * kWholeShare;
    const float mixed = share == kUnknownShare ? fresh : share + part * (fresh - share);
    share = static_cast<SharePart>(mixed + 0.5f);
  }
}

SharePart HiddenAhead::nearest_known(size_t slice, uint32_t address) const {
  for (size_t away = 0; away < kSlices; ++away)
    for (const size_t near : {slice + away, slice - away})  // wraps round to beyond kSlices where there is none before
      if (near < kSlices && shares(near)[address] != kUnknownShare) return shares(near)[address];
  return kUnknownShare;
}

void HiddenAhead::restart() {
  first_ = 0, next_s_ = kSliceS;
  for (Slice& slice : slices_) {
    slice.renewed = 0;
    std::fill(slice.shares.begin(), slice.shares.end(), kUnknownShare);
  }
}

}  // namespace sightline
