#include "server/record/byte_io.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace sightline {
namespace {

Error system_error(const std::string& doing, const std::string& path, int number) {
  std::string message = "cannot " + doing + ": ";
  message.append(std::strerror(number));
  return Error{code_of_system_error(number), path, std::move(message)};
}

class FileSink final : public ByteSink {
 public:
  FileSink(int descriptor, std::string path) : descriptor_(descriptor), path_(std::move(path)) {}
  FileSink(const FileSink&) = delete;
  FileSink& operator=(const FileSink&) = delete;
  ~FileSink() override { ::close(descriptor_); }

  Status write(std::string_view bytes) override {
    while (!bytes.empty()) {
      const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) return tl::unexpected(system_error("write", path_, errno));
      bytes.remove_prefix(static_cast<size_t>(written));
    }
    return {};
  }

 private:
  const int descriptor_;
  const std::string path_;
};

class FileSource final : public ByteSource {
 public:
  FileSource(int descriptor, std::string path, uint64_t size)
      : descriptor_(descriptor), path_(std::move(path)), size_(size) {}
  FileSource(const FileSource&) = delete;
  FileSource& operator=(const FileSource&) = delete;
  ~FileSource() override { ::close(descriptor_); }

  uint64_t size() const override { return size_; }

  Status read_at(uint64_t offset, char* out, size_t count) const override {
    if (offset > size_ || count > size_ - offset)
      return fail(ErrorCode::kDataLoss, path_, "the file ends before what is to be read");
    while (count > 0) {
      const ssize_t got = ::pread(descriptor_, out, count, static_cast<off_t>(offset));
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) return tl::unexpected(system_error("read", path_, errno));
      if (got == 0) return fail(ErrorCode::kDataLoss, path_, "the file became shorter while it was read");
      out += got;
      offset += static_cast<uint64_t>(got);
      count -= static_cast<size_t>(got);
    }
    return {};
  }

 private:
  const int descriptor_;
  const std::string path_;
  const uint64_t size_;
};

}  // namespace

ErrorCode code_of_system_error(int number) {
  switch (number) {
    case ENOENT:
      return ErrorCode::kNotFound;
    case EEXIST:
      return ErrorCode::kAlreadyExists;
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return ErrorCode::kResourceExhausted;
    default:
      return ErrorCode::kUnavailable;
  }
}

Status MemorySource::read_at(uint64_t offset, char* out, size_t count) const {
  if (offset > bytes_.size() || count > bytes_.size() - offset)
    return fail(ErrorCode::kDataLoss, "", "the bytes end before what is to be read");
  if (count > 0) std::memcpy(out, bytes_.data() + offset, count);
  return {};
}

Result<std::unique_ptr<ByteSink>> create_file_sink(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_APPEND, 0644);
  if (descriptor < 0) return tl::unexpected(system_error("create", path, errno));
  return std::make_unique<FileSink>(descriptor, path);
}

Result<std::unique_ptr<ByteSource>> open_file_source(const std::string& path) {
  // Without O_NONBLOCK, opening a pipe without a writer would block for ever.
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) return tl::unexpected(system_error("open", path, errno));
  struct stat status = {};
  const bool known = ::fstat(descriptor, &status) == 0;
  if (!known || !S_ISREG(status.st_mode)) {
    ::close(descriptor);
    return invalid(path, "is not a regular file");
  }
  return std::make_unique<FileSource>(descriptor, path, static_cast<uint64_t>(status.st_size));
}

}  // namespace sightline
