#include "client/base/file_bytes.h"

#include <fstream>
#include <iterator>
#include <span>

namespace sightline {

Result<std::vector<std::byte>> read_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  const std::string text(std::istreambuf_iterator<char>(in), {});
  if (!in) return fail(ErrorCode::kUnavailable, path, "cannot be read");
  const auto bytes = std::as_bytes(std::span(text));
  return std::vector<std::byte>(bytes.begin(), bytes.end());
}

}  // namespace sightline
