// Files that decide who may speak. They are small, and read again when they change.
#pragma once

#include <string>

#include "server/base/error.h"

namespace sightline {

// The whole file, of at most 1 MiB. `flag` is the field of the error, which is kInvalidArgument.
Result<std::string> read_small_file(const std::string& path, const std::string& flag);

}  // namespace sightline
