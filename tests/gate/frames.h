// The bytes that a client and a server send on HTTP/2.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace sightline::test {

inline const std::string kPreface = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

inline std::string frame(uint8_t type, uint8_t flags, uint32_t stream, const std::string& payload) {
  std::string bytes;
  for (const int shift : {16, 8, 0}) bytes.push_back(static_cast<char>(payload.size() >> shift));
  bytes.push_back(static_cast<char>(type));
  bytes.push_back(static_cast<char>(flags));
  for (const int shift : {24, 16, 8, 0}) bytes.push_back(static_cast<char>(stream >> shift));
  return bytes + payload;
}

inline std::string frame(uint8_t type, uint8_t flags, uint32_t stream, size_t length) {
  return frame(type, flags, stream, std::string(length, 'x'));
}

// What a client sends first.
inline std::string greeting() {
  return kPreface + frame(4, 0, 0, 6);
}

// The beginning of a call, which has the stream 2 number + 1, with so many bytes of headers.
inline std::string call(uint32_t number, size_t header_bytes = 10) {
  return frame(1, 4, 2 * number + 1, header_bytes);
}

// The beginning of a message of gRPC: the length of its body, and as much of the body as is given.
inline std::string message(uint32_t announced, size_t body) {
  std::string bytes(1, '\0');
  for (const int shift : {24, 16, 8, 0}) bytes.push_back(static_cast<char>(announced >> shift));
  return bytes + std::string(body, 'x');
}
inline std::string message(size_t body) {
  return message(static_cast<uint32_t>(body), body);
}

// The server lets the client send so many bytes more.
inline std::string window_update(uint32_t stream, uint32_t bytes) {
  std::string payload;
  for (const int shift : {24, 16, 8, 0}) payload.push_back(static_cast<char>(bytes >> shift));
  return frame(8, 0, stream, payload);
}

}  // namespace sightline::test
