#include "server/gate/small_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "server/gate/listening_socket.h"

namespace sightline {
namespace {

constexpr size_t kMostBytes = 1 << 20;

}  // namespace

Result<std::string> read_small_file(const std::string& path, const std::string& flag) {
  // A pipe would otherwise hold up the start until somebody writes to it.
  const FileDescriptor fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!fd) return invalid(flag, path + ": " + std::strerror(errno));
  std::string text;
  char buffer[4096];
  for (;;) {
    const ssize_t size = ::read(fd.get(), buffer, sizeof(buffer));
    if (size < 0) return invalid(flag, path + ": " + std::strerror(errno));
    if (size == 0) return text;
    text.append(buffer, static_cast<size_t>(size));
    if (text.size() > kMostBytes) return invalid(flag, path + ": larger than 1 MiB");
  }
}

}  // namespace sightline
