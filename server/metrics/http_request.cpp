#include "server/metrics/http_request.h"

#include <algorithm>

namespace sightline {
namespace {

constexpr std::string_view kScheme = "http://";

// An empty line ends the head. Lines end with a line feed, usually after a carriage return.
bool ends_head(std::string_view bytes, size_t scanned) {
  const size_t from = scanned > 3 ? scanned - 3 : 0;
  return bytes.find("\n\r\n", from) != std::string_view::npos || bytes.find("\n\n", from) != std::string_view::npos;
}

// A proxy sends the whole address.
std::string_view path_of(std::string_view target) {
  if (target.starts_with(kScheme)) {
    target.remove_prefix(kScheme.size());
    target.remove_prefix(std::min(target.find('/'), target.size()));
  }
  return target.substr(0, target.find('?'));
}

}  // namespace

HeadState read_request_head(std::string_view bytes, size_t scanned, HttpRequest& request) {
  if (!ends_head(bytes, scanned)) return HeadState::kIncomplete;
  std::string_view line = bytes.substr(0, bytes.find('\n'));
  if (line.ends_with('\r')) line.remove_suffix(1);
  const size_t first = line.find(' '), last = line.rfind(' ');
  if (first == std::string_view::npos || first == 0 || first == last || !line.substr(last + 1).starts_with("HTTP/1."))
    return HeadState::kWrong;
  request.method = line.substr(0, first);
  request.path = path_of(line.substr(first + 1, last - first - 1));
  return HeadState::kComplete;
}

}  // namespace sightline
