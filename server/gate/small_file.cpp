#include "server/gate/small_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "server/gate/listening_socket.h"

namespace sightline {
namespace {

// A lease for reading is only granted on a file that nobody has open for writing.
bool is_being_written(int fd) {
  if (::fcntl(fd, F_SETLEASE, F_RDLCK) == 0) {
    ::fcntl(fd, F_SETLEASE, F_UNLCK);
    return false;
  }
  return errno == EAGAIN;
}

}  // namespace

Result<SmallFile> look_at_small_file(const std::string& path, const std::string& flag) {
  // Opening a pipe would otherwise wait until somebody writes to it.
  const FileDescriptor fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  SmallFile file;
  if (!fd || ::fstat(fd.get(), &file.state) != 0) return invalid(flag, path + ": " + std::strerror(errno));
  if (!S_ISREG(file.state.st_mode))
    return invalid(flag, path + ": must be a regular file, not a folder, a pipe or a device");
  char buffer[4096];
  for (;;) {
    const ssize_t size = ::read(fd.get(), buffer, sizeof(buffer));
    if (size < 0) return invalid(flag, path + ": " + std::strerror(errno));
    if (size == 0) break;
    file.text.append(buffer, static_cast<size_t>(size));
    if (file.text.size() > kMostFileBytes) return invalid(flag, path + ": larger than 1 MiB");
  }
  if (::fstat(fd.get(), &file.state) != 0) return invalid(flag, path + ": " + std::strerror(errno));
  file.being_written = is_being_written(fd.get());
  return file;
}

Result<std::string> read_small_file(const std::string& path, const std::string& flag) {
  auto file = look_at_small_file(path, flag);
  if (!file) return tl::unexpected(std::move(file.error()));
  return std::move(file->text);
}

std::string exposed_by_mode(const std::string& path, bool secret) {
  struct stat state {};
  if (::stat(path.c_str(), &state) != 0) return {};
  const bool writes = (state.st_mode & S_IWOTH) != 0, reads = secret && (state.st_mode & S_IROTH) != 0;
  if (!writes && !reads) return {};
  char mode[32];
  std::snprintf(mode, sizeof(mode), "%04o", static_cast<unsigned>(state.st_mode & 07777));
  return path + ": others can " +
         (writes && reads ? "read and write"
          : writes        ? "write"
                          : "read") +
         " it (mode " + mode + ")";
}

}  // namespace sightline
