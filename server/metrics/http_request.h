// What a client asks of the small HTTP server (http_port.h): the head of one request of HTTP/1.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sightline {

struct HttpRequest {
  std::string method;  // "GET"
  std::string path;    // "/metrics", without what follows a question mark
};

// Reads a request of which `bytes` is the beginning. `scanned` says how many bytes an earlier call for the same request
// has seen, so that a head that comes byte by byte is not searched again and again.
enum class HeadState { kIncomplete, kComplete, kWrong };
HeadState read_request_head(std::string_view bytes, size_t scanned, HttpRequest& request);

}  // namespace sightline
