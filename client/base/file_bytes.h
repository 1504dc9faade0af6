// A file as bytes.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "server/base/error.h"

namespace sightline {

// kUnavailable, the path as field, when it cannot be read.
Result<std::vector<std::byte>> read_file(const std::string& path);

}  // namespace sightline
