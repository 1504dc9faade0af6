#include "client/page/page_data.h"

#include <zlib.h>

#include <bit>
#include <cassert>
#include <new>

namespace sightline {

static_assert(std::endian::native == std::endian::little);

std::string to_base64(std::span<const uint8_t> bytes) {
  static constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    const auto byte = [&](size_t k) { return i + k < bytes.size() ? uint32_t{bytes[i + k]} : 0u; };
    const uint32_t word = byte(0) << 16 | byte(1) << 8 | byte(2);
    for (int shift = 18; shift >= 0; shift -= 6) text.push_back(kDigits[word >> shift & 63u]);
  }
  const size_t padding = (3 - bytes.size() % 3) % 3;
  text.replace(text.size() - padding, padding, padding, '=');
  return text;
}

void PageData::add_bytes(const std::string& name, const char* type, std::span<const std::byte> bytes, size_t count) {
  [[maybe_unused]] const bool added = directory_.emplace(name, Entry{type, bytes_.size(), count}).second;
  assert(added);
  const auto* data = reinterpret_cast<const uint8_t*>(bytes.data());
  bytes_.insert(bytes_.end(), data, data + bytes.size());
  bytes_.resize((bytes_.size() + 7) / 8 * 8);
}

std::string PageData::encoded() const {
  std::vector<uint8_t> deflated(compressBound(bytes_.size()));
  uLongf size = deflated.size();
  if (compress2(deflated.data(), &size, bytes_.data(), bytes_.size(), Z_DEFAULT_COMPRESSION) != Z_OK)
    throw std::bad_alloc();  // the one failure that is left when the output has the size that zlib asks for
  return to_base64({deflated.data(), size});
}

}  // namespace sightline
