// Packs and unpacks the records of a chunk. Chunks are packed with zstd (RFC 8878) or stay as they are. Chunks of other
// programs may be packed with lz4 (LZ4 frames) too, and are unpacked.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "server/base/error.h"
#include "server/record/mcap_format.h"

struct ZSTD_CCtx_s;
struct ZSTD_DCtx_s;
struct LZ4F_dctx_s;

namespace sightline {

// Keeps its working memory from chunk to chunk. Not thread-safe.
class ChunkPacker {
 public:
  // Level as zstd counts, [1, 19]; 0: as they are.
  explicit ChunkPacker(int zstd_level);
  ~ChunkPacker();

  // Fills `compression`, `records`, size and CRC of the chunk. `records` is a view that is valid until the next call;
  // with level 0 it is a view of `raw`.
  Status pack(std::string_view raw, mcap::Chunk& out);

 private:
  struct Free {
    void operator()(ZSTD_CCtx_s* context) const;
  };
  const int level_;
  std::unique_ptr<ZSTD_CCtx_s, Free> context_;
  std::string packed_;
};

// What a reader says of a file whose chunks unpack to more than it may.
Error unpacks_too_far(uint64_t max_total_bytes);

// Not thread-safe.
class ChunkUnpacker {
 public:
  // No chunk may declare more than `max_bytes` of records, and all together no more than `max_total_bytes`.
  ChunkUnpacker(uint64_t max_bytes, uint64_t max_total_bytes);
  ~ChunkUnpacker();

  // The chunk's records, valid until the next call. Allocates at most max_bytes, and writes no more than the chunk
  // declares, however far the packed bytes would expand. Fails with kResourceExhausted over the limit, kUnsupported for
  // a compression that this build does not have, kDataLoss for wrong sizes, unreadable bytes or a wrong CRC.
  Result<std::string_view> unpack(const mcap::Chunk& chunk);
  // A chunk was refused for the sake of `max_total_bytes`: every later one is too.
  bool exhausted() const { return exhausted_; }

 private:
  Result<std::string_view> unpack_zstd(const mcap::Chunk& chunk);
  Result<std::string_view> unpack_lz4(const mcap::Chunk& chunk);

  struct Free {
    void operator()(ZSTD_DCtx_s* context) const;
    void operator()(LZ4F_dctx_s* context) const;
  };
  const uint64_t max_bytes_, max_total_bytes_;
  uint64_t left_;  // of max_total_bytes_
  bool exhausted_ = false;
  std::unique_ptr<ZSTD_DCtx_s, Free> context_;
  std::unique_ptr<LZ4F_dctx_s, Free> lz4_context_;  // made for the first chunk that needs it
  std::string raw_;
};

}  // namespace sightline
