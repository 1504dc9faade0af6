#include "server/gate/listening_socket.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>

namespace sightline {
namespace {

constexpr int kBacklog = 1024;
constexpr char kTcp[] = "--listen", kUnix[] = "--listen-unix";

Result<sockaddr_un> socket_address(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) {
    return invalid(kUnix,
                   "a socket path has at most " + std::to_string(sizeof(address.sun_path) - 1) + " bytes: " + path);
  }
  std::memcpy(address.sun_path, path.c_str(), path.size());
  return address;
}

// The errno of connecting; 0 when a process serves the socket.
int try_to_connect(const sockaddr_un& address) {
  const FileDescriptor fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!fd) return errno;
  return ::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 ? 0 : errno;
}

Error not_a_socket(const std::string& path) {
  return {ErrorCode::kInvalidArgument, kUnix, path + " exists and is not a socket"};
}

// Removes a stale socket file.
Status make_way_for_socket(const std::string& path, const sockaddr_un& address) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0) return {};
  if (!S_ISSOCK(info.st_mode)) return tl::unexpected(not_a_socket(path));
  if (const int error = try_to_connect(address); error != ECONNREFUSED) {
    const std::string why = error == 0 || error == EAGAIN ? "another process serves it" : std::strerror(error);
    return fail(ErrorCode::kUnavailable, kUnix, path + ": " + why);
  }
  if (::unlink(path.c_str()) != 0) return fail(ErrorCode::kUnavailable, kUnix, path + ": " + std::strerror(errno));
  return {};
}

tl::unexpected<Error> cannot_listen(const char* flag, const std::string& address, int error) {
  return fail(ErrorCode::kUnavailable, flag,
              "cannot listen at " + address + ": the address is in use or not valid on this machine (" +
                  std::strerror(error) + ")");
}

using AddressList = std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)>;

AddressList resolve(const std::string& host, const std::string& port) {
  addrinfo hints{}, *found = nullptr;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE;
  const bool bracketed = host.size() > 1 && host.front() == '[' && host.back() == ']';
  const std::string bare = bracketed ? host.substr(1, host.size() - 2) : host;
  const char* const node = bare.empty() || bare == "*" ? nullptr : bare.c_str();
  if (::getaddrinfo(node, port.c_str(), &hints, &found) != 0) found = nullptr;
  return {found, &::freeaddrinfo};
}

int open_tcp(const addrinfo& address) {
  FileDescriptor fd(::socket(address.ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!fd) return -1;
  const int on = 1, off = 0;
  ::setsockopt(fd.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  // Accepted sockets inherit this. Without it a reply could wait for the acknowledgement of the one before.
  ::setsockopt(fd.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  if (address.ai_family == AF_INET6) ::setsockopt(fd.get(), IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof(off));
  if (::bind(fd.get(), address.ai_addr, address.ai_addrlen) != 0 || ::listen(fd.get(), kBacklog) != 0) return -1;
  return fd.release();
}

sockaddr_storage address_of(int fd) {
  sockaddr_storage address{};
  socklen_t length = sizeof(address);
  ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length);
  return address;
}

// The port is at the same place in both families.
int port_of(const sockaddr_storage& address) {
  return ntohs(reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

bool is_loopback(const sockaddr& address) {
  if (address.sa_family == AF_INET)
    return (ntohl(reinterpret_cast<const sockaddr_in&>(address).sin_addr.s_addr) >> 24) == IN_LOOPBACKNET;
  const in6_addr& six = reinterpret_cast<const sockaddr_in6&>(address).sin6_addr;
  if (IN6_IS_ADDR_V4MAPPED(&six)) return six.s6_addr[12] == IN_LOOPBACKNET;
  return IN6_IS_ADDR_LOOPBACK(&six);
}

}  // namespace

FileDescriptor& FileDescriptor::operator=(FileDescriptor&& other) noexcept {
  if (this != &other) {
    if (fd_ >= 0) ::close(fd_);
    fd_ = other.release();
  }
  return *this;
}

FileDescriptor::~FileDescriptor() {
  if (fd_ >= 0) ::close(fd_);
}

Result<bool> ListeningSocket::stays_on_host(const std::string& address, const std::string& flag) {
  const size_t colon = address.rfind(':');
  if (colon == std::string::npos) return invalid(flag, "must be HOST:PORT, got " + address);
  const AddressList found = resolve(address.substr(0, colon), address.substr(colon + 1));
  if (!found)
    return fail(ErrorCode::kUnavailable, flag, "cannot listen at " + address + ": this machine knows no such host");
  return is_loopback(*found->ai_addr);
}

Status ListeningSocket::check_unix_path(const std::string& path) {
  if (const auto address = socket_address(path); !address) return tl::unexpected(address.error());
  struct stat info {};
  const bool taken = ::lstat(path.c_str(), &info) == 0 && !S_ISSOCK(info.st_mode);
  return taken ? tl::unexpected(not_a_socket(path)) : Status{};
}

Result<ListeningSocket> ListeningSocket::tcp(const std::string& address) {
  const size_t colon = address.rfind(':');
  if (colon == std::string::npos) return invalid(kTcp, "must be HOST:PORT, got " + address);
  const AddressList found = resolve(address.substr(0, colon), address.substr(colon + 1));
  int error = EADDRNOTAVAIL;
  for (const addrinfo* at = found.get(); at; at = at->ai_next) {
    ListeningSocket socket;
    socket.fd_ = FileDescriptor(open_tcp(*at));
    if (!socket.fd_) {
      error = errno;
      continue;
    }
    const sockaddr_storage bound = address_of(socket.fd());
    socket.port_ = port_of(bound);
    socket.stays_on_host_ = is_loopback(reinterpret_cast<const sockaddr&>(bound));
    socket.address_ = address.substr(0, colon + 1) + std::to_string(socket.port_);
    return socket;
  }
  return cannot_listen(kTcp, address, error);
}

Result<ListeningSocket> ListeningSocket::unix_file(const std::string& path, unsigned mode) {
  const auto address = socket_address(path);
  if (!address) return tl::unexpected(address.error());
  if (Status status = make_way_for_socket(path, *address); !status) return tl::unexpected(std::move(status.error()));
  ListeningSocket socket;
  socket.fd_ = FileDescriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket.fd_) return cannot_listen(kUnix, path, errno);
  // The umask makes sure that the socket never has wider permissions than its mode.
  const mode_t former_umask = ::umask(0777 & ~mode);
  const bool bound = ::bind(socket.fd(), reinterpret_cast<const sockaddr*>(&*address), sizeof(*address)) == 0;
  const int error = errno;
  ::umask(former_umask);
  if (!bound) return cannot_listen(kUnix, path, error);
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0 || ::listen(socket.fd(), kBacklog) != 0)
    return cannot_listen(kUnix, path, errno);
  socket.device_ = info.st_dev;
  socket.inode_ = info.st_ino;
  socket.path_ = path;
  socket.address_ = "unix:" + path;
  return socket;
}

// A moved-from socket has no descriptor and owns no file.
ListeningSocket::~ListeningSocket() {
  if (!fd_ || path_.empty()) return;
  struct stat info {};
  if (::lstat(path_.c_str(), &info) == 0 && info.st_dev == device_ && info.st_ino == inode_) ::unlink(path_.c_str());
}

}  // namespace sightline
