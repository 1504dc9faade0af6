// A chunk's records, packed and unpacked: zstd (RFC 8878), or as they are. lz4, the third that MCAP knows, is refused
// by name.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "server/base/error.h"
#include "server/record/mcap_format.h"

struct ZSTD_CCtx_s;
struct ZSTD_DCtx_s;

namespace sightline {

// Keeps its working memory from chunk to chunk. Not thread-safe.
class ChunkPacker {
 public:
  // Level as zstd counts, [1, 19]; 0: as they are.
  explicit ChunkPacker(int zstd_level);
  ~ChunkPacker();

  // Fills `compression`, `records`, size and CRC of the chunk; `records` is a view that lasts until the next call, of
  // `raw` itself where packing is off.
  Status pack(std::string_view raw, mcap::Chunk& out);

 private:
  struct Free {
    void operator()(ZSTD_CCtx_s* context) const;
  };
  const int level_;
  std::unique_ptr<ZSTD_CCtx_s, Free> context_;
  std::string packed_;
};

// Not thread-safe.
class ChunkUnpacker {
 public:
  // No chunk may declare more than `max_bytes` of records.
  explicit ChunkUnpacker(uint64_t max_bytes);
  ~ChunkUnpacker();

  // The chunk's records, valid until the next call. At most max_bytes are ever allocated and never more than the
  // chunk declares are written, whatever the packed bytes would grow to. Fails with kResourceExhausted over the
  // limit, kUnsupported for a compression that this build does not have, kDataLoss for wrong sizes, unreadable bytes
  // or a wrong CRC.
  Result<std::string_view> unpack(const mcap::Chunk& chunk);

 private:
  Result<std::string_view> unpack_zstd(const mcap::Chunk& chunk);

  struct Free {
    void operator()(ZSTD_DCtx_s* context) const;
  };
  const uint64_t max_bytes_;
  std::unique_ptr<ZSTD_DCtx_s, Free> context_;
  std::string raw_;
};

}  // namespace sightline
