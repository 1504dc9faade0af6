// Files that decide who may speak. They are small, and read again when they change.
#pragma once

#include <sys/stat.h>

#include <string>

#include "server/base/error.h"

namespace sightline {

// The largest of them.
inline constexpr size_t kMostFileBytes = 1 << 20;

struct SmallFile {
  std::string text;
  struct stat state {};  // after it was read
  // A process has it open for writing. False also where the system does not tell: the file is another user's, or on a
  // network.
  bool being_written = false;
};

// The whole file, of at most kMostFileBytes. `flag` is the field of the error, which is kInvalidArgument. Only a
// regular file is read: a pipe would hold up the reader, and a device may never end.
Result<SmallFile> look_at_small_file(const std::string& path, const std::string& flag);
Result<std::string> read_small_file(const std::string& path, const std::string& flag);

// What its mode lets other users of the machine do with a file: "others can read it (mode 0644)". Empty: nothing that
// matters, or there is no such file. `secret`: reading matters; writing always does.
std::string exposed_by_mode(const std::string& path, bool secret);

}  // namespace sightline
