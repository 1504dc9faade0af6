// Reading files below one folder and nowhere else. The kernel resolves the path with RESOLVE_BENEATH (openat2(2),
// Linux 5.6). Where that call is missing, the path of the opened file is compared with the folder's. A link that is
// swapped between check and use therefore does not help an attacker.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "server/base/error.h"

namespace sightline {

struct FileStamp {
  int64_t modified_ns = 0;  // since the epoch
  uint64_t size_bytes = 0;
  bool operator==(const FileStamp&) const = default;
};

struct FileContent {
  std::vector<std::byte> bytes;
  FileStamp stamp;
};

// Owns a descriptor of the folder. Thread-safe. Errors carry no field; the caller knows which name was asked
// for.
class ConfinedFolder {
 public:
  // kNotFound when `path` is not a folder that can be opened.
  static Result<ConfinedFolder> open(const std::string& path);
  ConfinedFolder(ConfinedFolder&& other) noexcept;
  ConfinedFolder& operator=(ConfinedFolder&&) = delete;
  ~ConfinedFolder();

  // Fails with kInvalidArgument if `relative_path` is absolute, contains "..", leaves the folder through a link, or is
  // not an ordinary file. Fails with kNotFound, or with kResourceExhausted above `max_bytes`.
  Result<FileContent> read(const std::string& relative_path, size_t max_bytes) const;
  // The stamp alone, for asking whether a file changed.
  Result<FileStamp> stamp(const std::string& relative_path) const;

 private:
  explicit ConfinedFolder(int descriptor) : descriptor_(descriptor) {}
  Result<int> open_beneath(const std::string& relative_path) const;

  int descriptor_;
};

// Any ordinary file, for paths that a person gave on the command line.
Result<std::vector<std::byte>> read_whole_file(const std::string& path, size_t max_bytes);

}  // namespace sightline
