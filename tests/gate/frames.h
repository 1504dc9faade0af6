// The bytes that a client sends on HTTP/2.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace sightline::test {

inline const std::string kPreface = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

inline std::string frame(uint8_t type, uint8_t flags, uint32_t stream, size_t length) {
  std::string bytes;
  for (const int shift : {16, 8, 0}) bytes.push_back(static_cast<char>(length >> shift));
  bytes.push_back(static_cast<char>(type));
  bytes.push_back(static_cast<char>(flags));
  for (const int shift : {24, 16, 8, 0}) bytes.push_back(static_cast<char>(stream >> shift));
  return bytes + std::string(length, 'x');
}

// What a client sends first.
inline std::string greeting() {
  return kPreface + frame(4, 0, 0, 6);
}

// The beginning of a call.
inline std::string call(uint32_t number) {
  return frame(1, 4, 2 * number + 1, 10);
}

}  // namespace sightline::test
