#include "server/gate/connection.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <chrono>
#include <cstring>
#include <utility>

namespace sightline {
namespace {

std::string name_of(const in6_addr& address) {
  char text[INET6_ADDRSTRLEN] = "";
  if (IN6_IS_ADDR_V4MAPPED(&address)) return ::inet_ntop(AF_INET, &address.s6_addr[12], text, sizeof(text));
  in6_addr network = address;
  if (!IN6_IS_ADDR_LOOPBACK(&address)) std::memset(&network.s6_addr[8], 0, 8);
  ::inet_ntop(AF_INET6, &network, text, sizeof(text));
  return IN6_IS_ADDR_LOOPBACK(&address) ? text : std::string(text) + "/64";
}

}  // namespace

std::string client_of_socket(int fd) {
  sockaddr_storage address{};
  socklen_t length = sizeof(address);
  if (::getpeername(fd, reinterpret_cast<sockaddr*>(&address), &length) != 0) return "unknown";
  if (address.ss_family == AF_INET) {
    char text[INET_ADDRSTRLEN] = "";
    ::inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in&>(address).sin_addr, text, sizeof(text));
    return text;
  }
  if (address.ss_family == AF_INET6) return name_of(reinterpret_cast<const sockaddr_in6&>(address).sin6_addr);
  const auto user = user_of_socket(fd);
  return user ? "uid " + std::to_string(*user) : "unknown";
}

std::optional<unsigned> user_of_socket(int fd) {
  ucred user{};
  socklen_t size = sizeof(user);
  int domain = 0;
  socklen_t domain_size = sizeof(domain);
  if (::getsockopt(fd, SOL_SOCKET, SO_DOMAIN, &domain, &domain_size) != 0 || domain != AF_UNIX) return std::nullopt;
  if (::getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &user, &size) != 0) return std::nullopt;
  return user.uid;
}

std::string Connection::certificate() const {
  const MutexLock lock(mutex_);
  return certificate_;
}

void Connection::set_certificate(std::string name) {
  const MutexLock lock(mutex_);
  certificate_ = std::move(name);
}

double gate_now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace sightline
