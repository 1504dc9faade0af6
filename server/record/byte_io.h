// Interfaces for writing and reading the bytes of a recording. A std::string_view holds bytes here, not text.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "server/base/error.h"

namespace sightline {

// An end to append to. Not thread-safe.
class ByteSink {
 public:
  virtual ~ByteSink() = default;
  // Appends all of `bytes`, so that they outlive this process, or fails (kUnavailable; kResourceExhausted when the
  // device is full). After a failure any part of them may have been appended.
  virtual Status write(std::string_view bytes) = 0;
};

// Bytes at known offsets. Safe from several threads when the implementation says so; the two below are.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  virtual uint64_t size() const = 0;
  // Fills `out` from `offset` on. kDataLoss when the range reaches beyond the end, kUnavailable when it cannot be read.
  virtual Status read_at(uint64_t offset, char* out, size_t count) const = 0;
};

class MemorySink final : public ByteSink {
 public:
  Status write(std::string_view bytes) override {
    bytes_.append(bytes);
    return {};
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

// A view: the bytes must outlive it.
class MemorySource final : public ByteSource {
 public:
  explicit MemorySource(std::string_view bytes) : bytes_(bytes) {}
  uint64_t size() const override { return bytes_.size(); }
  Status read_at(uint64_t offset, char* out, size_t count) const override;

 private:
  std::string_view bytes_;
};

// kNotFound, kAlreadyExists, kResourceExhausted when the device is full or the file as large as it may be, otherwise
// kUnavailable.
ErrorCode code_of_system_error(int number);

// A new file; an existing one is refused (kAlreadyExists). Every write goes to the system at once: written bytes
// survive a kill of the process, but not a power cut.
Result<std::unique_ptr<ByteSink>> create_file_sink(const std::string& path);
// Fails with kNotFound or kUnavailable; folders and pipes are kInvalidArgument. Its size is fixed when it is opened.
Result<std::unique_ptr<ByteSource>> open_file_source(const std::string& path);

}  // namespace sightline
