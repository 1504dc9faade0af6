#include "server/scene/gltf_container.h"

#include <cstdint>
#include <cstring>

namespace sightline {
namespace {

constexpr uint32_t kMagic = 0x46546C67;        // "glTF"
constexpr uint32_t kJsonChunk = 0x4E4F534A;    // "JSON"
constexpr uint32_t kBinaryChunk = 0x004E4942;  // "BIN\0"
constexpr size_t kHeaderBytes = 12;
constexpr size_t kChunkHeaderBytes = 8;

// Little-endian by the format, and so is every machine that we build for.
uint32_t u32_at(std::span<const std::byte> bytes, size_t offset) {
  uint32_t value = 0;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

struct Chunk {
  uint32_t type = 0;
  std::span<const std::byte> data;
};

Result<Chunk> chunk_at(std::span<const std::byte> glb, size_t offset, size_t index) {
  const std::string field = "glb.chunks[" + std::to_string(index) + "]";
  if (glb.size() - offset < kChunkHeaderBytes)
    return fail(ErrorCode::kDataLoss, field, "the file ends inside a chunk header");
  const size_t length = u32_at(glb, offset);
  if (length > glb.size() - offset - kChunkHeaderBytes)
    return fail(ErrorCode::kDataLoss, field, "is longer than the file");
  return Chunk{u32_at(glb, offset + 4), glb.subspan(offset + kChunkHeaderBytes, length)};
}

Result<std::span<const std::byte>> check_header(std::span<const std::byte> bytes) {
  if (bytes.size() < kHeaderBytes) return fail(ErrorCode::kDataLoss, "glb.header", "the file ends inside the header");
  if (const uint32_t version = u32_at(bytes, 4); version != 2)
    return fail(ErrorCode::kUnsupported, "glb.header.version", "must be 2, got " + std::to_string(version));
  const size_t length = u32_at(bytes, 8);
  if (length < kHeaderBytes || length > bytes.size())
    return fail(ErrorCode::kDataLoss, "glb.header.length",
                "says " + std::to_string(length) + " bytes, the file has " + std::to_string(bytes.size()));
  return bytes.first(length);
}

Result<GltfContainer> split_glb(std::span<const std::byte> bytes) {
  const auto glb = check_header(bytes);
  if (!glb) return tl::unexpected(glb.error());
  GltfContainer container;
  size_t index = 0;
  for (size_t offset = kHeaderBytes; offset < glb->size(); ++index) {
    const auto chunk = chunk_at(*glb, offset, index);
    if (!chunk) return tl::unexpected(chunk.error());
    if ((index == 0) != (chunk->type == kJsonChunk))
      return fail(ErrorCode::kDataLoss, "glb.chunks[" + std::to_string(index) + "]",
                  "the first chunk and no other must be JSON");
    if (index == 0) container.json = {reinterpret_cast<const char*>(chunk->data.data()), chunk->data.size()};
    if (index == 1 && chunk->type == kBinaryChunk) container.binary_chunk = chunk->data;
    offset += kChunkHeaderBytes + chunk->data.size();
  }
  if (index == 0) return fail(ErrorCode::kDataLoss, "glb.chunks[0]", "the file has no JSON chunk");
  return container;
}

}  // namespace

Result<GltfContainer> split_gltf_container(std::span<const std::byte> bytes) {
  if (bytes.size() >= 4 && u32_at(bytes, 0) == kMagic) return split_glb(bytes);
  return GltfContainer{{reinterpret_cast<const char*>(bytes.data()), bytes.size()}, std::nullopt};
}

}  // namespace sightline
