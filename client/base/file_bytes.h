// Reads a whole file into memory.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "server/base/error.h"

namespace sightline {

// kUnavailable, with the path in `field`, when the file cannot be read.
Result<std::vector<std::byte>> read_file(const std::string& path);

}  // namespace sightline
