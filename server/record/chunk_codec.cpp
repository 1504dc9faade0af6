#include "server/record/chunk_codec.h"

#include <lz4frame.h>
#include <zstd.h>

namespace sightline {

void ChunkPacker::Free::operator()(ZSTD_CCtx_s* context) const {
  ZSTD_freeCCtx(context);
}

ChunkPacker::ChunkPacker(int zstd_level) : level_(zstd_level), context_(zstd_level > 0 ? ZSTD_createCCtx() : nullptr) {}

ChunkPacker::~ChunkPacker() = default;

Status ChunkPacker::pack(std::string_view raw, mcap::Chunk& out) {
  out.uncompressed_size = raw.size();
  out.uncompressed_crc = mcap::crc32_of(raw);
  out.compression = level_ > 0 ? "zstd" : "";
  out.records = raw;
  if (level_ == 0) return {};
  packed_.resize(ZSTD_compressBound(raw.size()));
  const size_t size = ZSTD_compressCCtx(context_.get(), packed_.data(), packed_.size(), raw.data(), raw.size(), level_);
  if (ZSTD_isError(size)) return fail(ErrorCode::kInternal, "chunk", ZSTD_getErrorName(size));
  out.records = std::string_view(packed_).substr(0, size);
  return {};
}

void ChunkUnpacker::Free::operator()(ZSTD_DCtx_s* context) const {
  ZSTD_freeDCtx(context);
}

void ChunkUnpacker::Free::operator()(LZ4F_dctx_s* context) const {
  LZ4F_freeDecompressionContext(context);
}

Error unpacks_too_far(uint64_t max_total_bytes) {
  return {ErrorCode::kResourceExhausted, "",
          "its chunks unpack to more than " + std::to_string(max_total_bytes) +
              " bytes, the limit for a file of this size: no recorded session does"};
}

ChunkUnpacker::ChunkUnpacker(uint64_t max_bytes, uint64_t max_total_bytes)
    : max_bytes_(max_bytes), max_total_bytes_(max_total_bytes), left_(max_total_bytes), context_(ZSTD_createDCtx()) {}

ChunkUnpacker::~ChunkUnpacker() = default;

Result<std::string_view> ChunkUnpacker::unpack(const mcap::Chunk& chunk) {
  if (chunk.uncompressed_size > max_bytes_)
    return fail(ErrorCode::kResourceExhausted, "chunk.uncompressed_size",
                "must be at most " + std::to_string(max_bytes_) + ", got " + std::to_string(chunk.uncompressed_size));
  // What is not packed takes its own bytes of the file.
  if (!chunk.compression.empty()) {
    exhausted_ = exhausted_ || chunk.uncompressed_size > left_;
    if (exhausted_) return tl::unexpected(unpacks_too_far(max_total_bytes_));
    left_ -= chunk.uncompressed_size;
  }
  Result<std::string_view> raw = chunk.records;
  if (chunk.compression == "zstd")
    raw = unpack_zstd(chunk);
  else if (chunk.compression == "lz4")
    raw = unpack_lz4(chunk);
  else if (!chunk.compression.empty())
    return fail(ErrorCode::kUnsupported, "chunk.compression",
                "zstd, lz4 and none can be read, not \"" + std::string(chunk.compression.substr(0, 32)) + '"');
  if (!raw) return raw;
  if (raw->size() != chunk.uncompressed_size)
    return fail(ErrorCode::kDataLoss, "chunk.uncompressed_size", "is not the size of the records");
  if (chunk.uncompressed_crc != 0 && mcap::crc32_of(*raw) != chunk.uncompressed_crc)
    return fail(ErrorCode::kDataLoss, "chunk.uncompressed_crc", "is not the CRC of the records");
  return raw;
}

Result<std::string_view> ChunkUnpacker::unpack_zstd(const mcap::Chunk& chunk) {
  // The size that the frame claims is checked first, so that a false claim costs no memory. A frame without a claim is
  // limited by the size of `raw_`.
  const unsigned long long claimed = ZSTD_getFrameContentSize(chunk.records.data(), chunk.records.size());
  const bool lies = claimed != ZSTD_CONTENTSIZE_UNKNOWN && claimed > chunk.uncompressed_size;
  if (claimed == ZSTD_CONTENTSIZE_ERROR || lies)
    return fail(ErrorCode::kDataLoss, "chunk.records", "are not what the chunk declares");
  if (raw_.size() < chunk.uncompressed_size) raw_.resize(chunk.uncompressed_size);
  const size_t size = ZSTD_decompressDCtx(context_.get(), raw_.data(), chunk.uncompressed_size, chunk.records.data(),
                                          chunk.records.size());
  if (ZSTD_isError(size)) return fail(ErrorCode::kDataLoss, "chunk.records", ZSTD_getErrorName(size));
  return std::string_view(raw_).substr(0, size);
}

// A frame may follow another, as the format of LZ4 allows. Writes no more than the chunk declares.
Result<std::string_view> ChunkUnpacker::unpack_lz4(const mcap::Chunk& chunk) {
  const auto broken = [](const char* what) { return fail(ErrorCode::kDataLoss, "chunk.records", what); };
  LZ4F_dctx* made = nullptr;
  if (!lz4_context_ && LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)))
    return fail(ErrorCode::kResourceExhausted, "chunk.records", "there is no memory to unpack them");
  if (made) lz4_context_.reset(made);
  LZ4F_resetDecompressionContext(lz4_context_.get());
  if (raw_.size() < chunk.uncompressed_size) raw_.resize(chunk.uncompressed_size);
  size_t read = 0, written = 0, wanted = 0;  // wanted: 0 at the end of a frame
  while (read < chunk.records.size()) {
    size_t in = chunk.records.size() - read, out = chunk.uncompressed_size - written;
    wanted = LZ4F_decompress(lz4_context_.get(), raw_.data() + written, &out, chunk.records.data() + read, &in,
                             nullptr);
    if (LZ4F_isError(wanted)) return broken(LZ4F_getErrorName(wanted));
    if (in == 0 && out == 0) return broken("hold more than the chunk declares");
    read += in;
    written += out;
  }
  if (wanted != 0) return broken("end within an LZ4 frame");
  return std::string_view(raw_).substr(0, written);
}

}  // namespace sightline
