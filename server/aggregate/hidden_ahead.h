// What pictures from each cell of the lattice are expected to lack at coming times. They lack the targets that are
// hidden, and, where targets have come apart, those that do not fit the picture (picture_loss in move/sight_weight.h;
// move/picture_fit.h).
//
// The coming second is divided into slices: instants that are kSliceS apart and fixed on the session's clock. Each step
// renews the few slices whose estimates are oldest. A renewed estimate is mixed with the former one, so the noise of
// the maps averages out. The targets may go several ways; each renewal takes one of them, so these average out too.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/aggregate/lattice.h"
#include "server/base/inline_vector.h"

namespace sightline {

inline constexpr double kSliceS = 0.1;
inline constexpr size_t kSlices = 12;

// A share in parts of kWholeShare, in one byte, since a session keeps kSlices of them for each cell.
using SharePart = uint8_t;
inline constexpr SharePart kWholeShare = 254, kUnknownShare = 255;

// A slice to renew. `slice` counts from the nearest one; `ahead_s` is its time from the step's present, in (0, kSlices
// * kSliceS].
struct DueSlice {
  size_t slice = 0;
  double ahead_s = 0.0;
};

// A value type. Memory is kept from step to step. Not thread-safe. Deterministic.
class HiddenAhead {
 public:
  // The slices that a step which takes `dt_s` >= 0 should renew, oldest estimate first; at most `count`. Changes
  // nothing.
  InlineVector<DueSlice, kSlices> due(double dt_s, size_t count) const;

  // Goes on by `dt_s` and takes over the lattice's cells, which must have addresses. Slices that have passed become the
  // last ones, and nothing is known of them. Nothing is known of cells that are new to the lattice.
  void advance(const Lattice& lattice, double dt_s);
  // Mixes new shares, [0, 1], by cell of the lattice in its order, into a slice. The new share counts by `weight`, (0,
  // 1], where a share is known.
  void renew(size_t slice, const Lattice& lattice, std::span<const float> shares, double weight);
  // Forgets everything, the clock included.
  void restart();

  // The time from the present to a slice; ascending.
  double ahead_s(size_t slice) const { return next_s_ + kSliceS * static_cast<double>(slice); }
  // The expected shares by address of the lattice; kUnknownShare where nothing is known.
  std::span<const SharePart> shares(size_t slice) const { return at(slice).shares; }
  // The share at an address in the slice that is nearest in time to `slice` among those that are known there. Of two
  // that are equally near, the later one counts. kUnknownShare if none is known.
  SharePart nearest_known(size_t slice, uint32_t address) const;

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)
  struct Slice {
    uint64_t renewed = 0;  // number of the step that renewed it; 0: never
    std::vector<SharePart> shares;
  };
  // The number of slices that pass within `dt_s`, and the time from then to the first one that has not.
  struct Passing {
    size_t count;
    double next_s;
  };
  Passing passing(double dt_s) const;
  const Slice& at(size_t slice) const { return slices_[(first_ + slice) % kSlices]; }
  Slice& at(size_t slice) { return slices_[(first_ + slice) % kSlices]; }

  std::array<Slice, kSlices> slices_;  // a ring
  size_t first_ = 0;                   // the nearest slice
  double next_s_ = kSliceS;            // time from the present to it
  uint64_t steps_ = 0;
  uint64_t newest_owner_ = 0;  // the greatest number of a cell that was taken over
};

}  // namespace sightline
