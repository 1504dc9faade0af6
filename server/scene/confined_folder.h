// Reading files below one folder and nowhere else. The path is resolved by the kernel with RESOLVE_BENEATH
// (openat2(2), Linux 5.6); where that call is missing the opened file's own path is compared with the
// folder's, so that a link swapped between check and use gains nothing.
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

  // `relative_path` without ".." and not absolute, else kInvalidArgument; so is one that leaves the folder
  // through a link. kNotFound, kInvalidArgument for what is not an ordinary file, kResourceExhausted above
  // `max_bytes`.
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
