#include "server/scene/confined_folder.h"

#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstring>
#include <utility>

namespace sightline {
namespace {

// Never waits on a pipe, never becomes a controlling terminal.
constexpr int kOpenFlags = O_RDONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK;

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(const Descriptor&) = delete;
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  int get() const { return fd_; }
  int release() { return std::exchange(fd_, -1); }

 private:
  int fd_;
};

tl::unexpected<Error> errno_error(int code, const std::string& path) {
  const std::string text = "\"" + path + "\": " + std::strerror(code);
  switch (code) {
    case ENOENT:
    case ENOTDIR:
      return fail(ErrorCode::kNotFound, "", text);
    case EXDEV:
    case ELOOP:
      return invalid("", "\"" + path + "\" leads out of its folder");
    case ENAMETOOLONG:
      return invalid("", text);
    default:
      return fail(ErrorCode::kUnavailable, "", text);
  }
}

Result<std::string> path_of_descriptor(int fd) {
  char path[PATH_MAX];
  const ssize_t length = ::readlink(("/proc/self/fd/" + std::to_string(fd)).c_str(), path, sizeof path);
  if (length < 0) return errno_error(errno, "/proc/self/fd");
  return std::string(path, static_cast<size_t>(length));
}

// For kernels and sandboxes without openat2: open, then ask where the opened file really is.
Result<int> open_and_compare(int folder, const std::string& relative_path) {
  Descriptor file(::openat(folder, relative_path.c_str(), kOpenFlags));
  if (file.get() < 0) return errno_error(errno, relative_path);
  auto folder_path = path_of_descriptor(folder);
  const auto file_path = path_of_descriptor(file.get());
  if (!folder_path) return tl::unexpected(folder_path.error());
  if (!file_path) return tl::unexpected(file_path.error());
  if (folder_path->back() != '/') folder_path->push_back('/');
  if (!file_path->starts_with(*folder_path)) return errno_error(EXDEV, relative_path);
  return file.release();
}

Result<FileStamp> stamp_of(int fd, const std::string& path) {
  struct stat info {};
  if (::fstat(fd, &info) != 0) return errno_error(errno, path);
  if (!S_ISREG(info.st_mode)) return invalid("", "\"" + path + "\" is not an ordinary file");
  return FileStamp{int64_t{info.st_mtim.tv_sec} * 1'000'000'000 + info.st_mtim.tv_nsec,
                   static_cast<uint64_t>(info.st_size)};
}

// A file that shrinks while it is read gives what is left; one that grows gives its first part.
Result<FileContent> read_descriptor(int fd, const std::string& path, size_t max_bytes) {
  const auto stamp = stamp_of(fd, path);
  if (!stamp) return tl::unexpected(stamp.error());
  if (stamp->size_bytes > max_bytes)
    return fail(ErrorCode::kResourceExhausted, "",
                "\"" + path + "\" is larger than " + std::to_string(max_bytes) + " bytes");
  FileContent content{std::vector<std::byte>(stamp->size_bytes), *stamp};
  size_t done = 0;
  while (done < content.bytes.size()) {
    const ssize_t got = ::read(fd, content.bytes.data() + done, content.bytes.size() - done);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return errno_error(errno, path);
    if (got == 0) break;
    done += static_cast<size_t>(got);
  }
  content.bytes.resize(done);
  return content;
}

bool stays_below(const std::string& path) {
  if (path.empty() || path.front() == '/' || path.find('\0') != std::string::npos) return false;
  return ("/" + path + "/").find("/../") == std::string::npos;
}

}  // namespace

Result<ConfinedFolder> ConfinedFolder::open(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return errno_error(errno, path);
  return ConfinedFolder(fd);
}

ConfinedFolder::ConfinedFolder(ConfinedFolder&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}

ConfinedFolder::~ConfinedFolder() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Result<int> ConfinedFolder::open_beneath(const std::string& relative_path) const {
  if (!stays_below(relative_path)) return invalid("", "must be a relative path without \"..\"");
  open_how how{};
  how.flags = kOpenFlags;
  how.resolve = RESOLVE_BENEATH | RESOLVE_NO_MAGICLINKS;
  const long fd = ::syscall(SYS_openat2, descriptor_, relative_path.c_str(), &how, sizeof how);
  if (fd >= 0) return static_cast<int>(fd);
  if (errno == ENOSYS || errno == EPERM || errno == EINVAL) return open_and_compare(descriptor_, relative_path);
  return errno_error(errno, relative_path);
}

Result<FileContent> ConfinedFolder::read(const std::string& relative_path, size_t max_bytes) const {
  const auto fd = open_beneath(relative_path);
  if (!fd) return tl::unexpected(fd.error());
  const Descriptor file(*fd);
  return read_descriptor(file.get(), relative_path, max_bytes);
}

Result<FileStamp> ConfinedFolder::stamp(const std::string& relative_path) const {
  const auto fd = open_beneath(relative_path);
  if (!fd) return tl::unexpected(fd.error());
  const Descriptor file(*fd);
  return stamp_of(file.get(), relative_path);
}

Result<std::vector<std::byte>> read_whole_file(const std::string& path, size_t max_bytes) {
  const Descriptor file(::open(path.c_str(), kOpenFlags));
  if (file.get() < 0) return errno_error(errno, path);
  auto content = read_descriptor(file.get(), path, max_bytes);
  if (!content) return tl::unexpected(std::move(content.error()));
  return std::move(content->bytes);
}

}  // namespace sightline
