// The parts of a file that could not be read, and the limits on the memory that a file can make its reader use.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/base/error.h"

namespace sightline {

// A file is untrusted: nothing that it declares makes a reader hold more than these limits.
struct McapLimits {
  uint64_t max_chunk_bytes = uint64_t{64} << 20;      // a chunk's records, unpacked
  uint64_t max_record_bytes = uint64_t{80} << 20;     // any record but an attachment, as stored
  uint64_t max_attachment_bytes = uint64_t{1} << 30;  // only when one is asked for
  uint64_t max_summary_bytes = uint64_t{64} << 20;
  uint64_t max_definition_bytes = uint64_t{64} << 20;  // all schemas and channels together
  // All chunks that one reading unpacks, together; empty: within kFreeUnpackedBytes and kMostExpansion times the file's
  // size. A few kilobytes can unpack to a whole chunk, so without it a small file would keep its reader busy for as
  // long as it likes. A session with 1,000 instances that never move unpacks to 64 times.
  std::optional<uint64_t> max_unpacked_bytes = {};

  static constexpr uint64_t kFreeUnpackedBytes = uint64_t{256} << 20, kMostExpansion = 512;
  uint64_t unpacked_within(uint64_t file_bytes) const {
    return max_unpacked_bytes.value_or(kFreeUnpackedBytes + kMostExpansion * file_bytes);
  }
};

struct McapTrouble {
  uint64_t offset = 0;  // of the record, from the start of the file
  Error error;
};

// Counts cover what is known to be missing. Unreadable stretches are counted in bytes only.
struct McapLoss {
  uint64_t chunks = 0;
  uint64_t messages = 0;                    // in lost chunks whose index is there, and outside chunks
  uint64_t bytes = 0;                       // of the file, that no sound record covers
  uint64_t troubles = 0;                    // all of them
  std::vector<McapTrouble> first_troubles;  // at most kKeptTroubles

  static constexpr size_t kKeptTroubles = 16;
  bool none() const { return troubles == 0; }
  void note(uint64_t offset, Error error) {
    ++troubles;
    if (first_troubles.size() < kKeptTroubles) first_troubles.push_back({offset, std::move(error)});
  }
};

}  // namespace sightline
