#include "server/metrics/http_port.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <new>
#include <string_view>
#include <utility>
#include <vector>

#include "server/gate/connection.h"

namespace sightline {
namespace {

using std::chrono::steady_clock;
using Stage = HttpConnection::Stage;

// Connections accepted in a round, so that those that are there are looked at in between.
constexpr int kAcceptsInRound = 16;
// A connection keeps its place for so long, so that its request can come, unless many wait for a place. A container may
// stand still so long when it has used up its share of the processors (a period of the kernel's quota).
constexpr std::chrono::milliseconds kLeastTime{100};
// After an accept that failed for want of descriptors or memory; without the pause the thread would spin.
constexpr std::chrono::milliseconds kAfterFailure{20};

int milliseconds_until(steady_clock::time_point time) {
  return static_cast<int>(
      std::max<int64_t>(0, std::chrono::ceil<std::chrono::milliseconds>(time - steady_clock::now()).count()));
}

HttpAnswer no_such_page(const HttpPort::Pages& pages) {
  std::string known = "There is no such page. There are:\n";
  for (const auto& [name, page] : pages) known += name + "\n";
  return {.status = 404, .body = std::move(known)};
}

}  // namespace

Result<std::unique_ptr<HttpPort>> HttpPort::start(const std::string& address, const std::string& field, Pages pages) {
  auto socket = ListeningSocket::tcp(address);
  if (!socket) {
    socket.error().field = field;
    return tl::unexpected(std::move(socket.error()));
  }
  FileDescriptor wake(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (!wake) return fail(ErrorCode::kUnavailable, field, "no file descriptor is left");
  return std::unique_ptr<HttpPort>(new HttpPort(std::move(*socket), std::move(wake), std::move(pages)));
}

HttpPort::HttpPort(ListeningSocket socket, FileDescriptor wake, Pages pages)
    : socket_(std::move(socket)),
      wake_(std::move(wake)),
      pages_(std::move(pages)),
      maker_([this] { this->wake(); }),
      thread_([this] { run(); }) {}

HttpPort::~HttpPort() {
  stopping_ = true;
  wake();
  thread_.join();
}

void HttpPort::wake() const {
  const uint64_t one = 1;
  // It fails only if the thread has been woken very often already.
  [[maybe_unused]] const ssize_t written = ::write(wake_.get(), &one, sizeof(one));
}

void HttpPort::run() {
  ::prctl(PR_SET_NAME, "http-port");  // for ps and debuggers
  while (!stopping_) try {
      wait();
      go_round();
    } catch (const std::bad_alloc&) {
      connections_.clear();
    }
}

// Waits until there is something to do.
void HttpPort::wait() {
  const auto now = steady_clock::now();
  const bool accepts = now >= accepts_again_;
  std::vector<pollfd> awaited{{wake_.get(), POLLIN, 0}, {accepts ? socket_.fd() : -1, POLLIN, 0}};
  auto next = accepts ? Time::max() : accepts_again_;
  for (const HttpConnection& connection : connections_) {
    awaited.push_back({connection.fd(), connection.awaited_events(), 0});
    next = std::min(next, connection.deadline());
  }
  ::poll(awaited.data(), awaited.size(), next == Time::max() ? -1 : milliseconds_until(next));
  uint64_t count = 0;
  if (awaited[0].revents != 0) [[maybe_unused]]
    const ssize_t taken = ::read(wake_.get(), &count, sizeof(count));
  size_t at = 2;
  for (HttpConnection& connection : connections_)
    if (awaited[at++].revents != 0) advance(connection, steady_clock::now());
}

void HttpPort::go_round() {
  const auto now = steady_clock::now();
  take_pages(now);
  connections_.remove_if(
      [now](const HttpConnection& one) { return one.stage() == Stage::kOver || one.deadline() <= now; });
  accept(now);
}

void HttpPort::advance(HttpConnection& connection, Time now) {
  const auto request = connection.advance(now);
  if (!request) return;
  const bool head_only = request->method == "HEAD";
  const auto page = pages_.find(request->path);
  if (page == pages_.end()) return connection.answer(no_such_page(pages_), head_only, now);
  if (!head_only && request->method != "GET")
    return connection.answer({.status = 405, .body = "Only GET and HEAD are answered.\n"}, false, now);
  if (page->second.takes_long)
    connection.wait_for_page(maker_.ask(page->second.make), head_only, now);
  else
    connection.answer(made(page->second.make), head_only, now);
}

void HttpPort::take_pages(Time now) {
  for (const PageMaker::Made& page : maker_.take())
    for (HttpConnection& connection : connections_)
      if (connection.waits_for_page(page.number)) connection.answer(*page.answer, connection.head_only(), now);
}

void HttpPort::accept(Time now) {
  for (int i = 0; i < kAcceptsInRound && now >= accepts_again_; ++i) {
    const auto gives_way = connections_.size() < kMostConnections ? connections_.end() : first_to_go();
    if (gives_way != connections_.end() && gives_way->stage() < Stage::kClosing &&
        now - gives_way->since() < kLeastTime && !many_wait()) {
      accepts_again_ = gives_way->since() + kLeastTime;
      return;
    }
    FileDescriptor fd(::accept4(socket_.fd(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!fd) {
      if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM)
        accepts_again_ = now + kAfterFailure;
      return;
    }
    if (gives_way != connections_.end()) connections_.erase(gives_way);
    std::string client = client_of_socket(fd.get());
    // The request has come with the connection, as a rule.
    advance(connections_.emplace_back(std::move(fd), std::move(client), now), now);
  }
}

// Of those that the kernel has connected. What a client has sent meanwhile is read as soon as its connection is
// accepted.
bool HttpPort::many_wait() const {
  tcp_info info{};
  socklen_t size = sizeof(info);
  const bool known = ::getsockopt(socket_.fd(), IPPROTO_TCP, TCP_INFO, &info, &size) == 0;
  return !known || 2 * info.tcpi_unacked >= info.tcpi_sacked;  // the queue of a listening socket, and its length
}

// A connection that has its answer, otherwise the oldest one of the client that has most.
HttpPort::Connections::iterator HttpPort::first_to_go() {
  const auto answered = std::find_if(connections_.begin(), connections_.end(),
                                     [](const auto& one) { return one.stage() >= Stage::kClosing; });
  if (answered != connections_.end()) return answered;
  std::map<std::string_view, size_t> of_client;
  size_t most = 0;
  for (const HttpConnection& one : connections_) most = std::max(most, ++of_client[one.client()]);
  return std::find_if(connections_.begin(), connections_.end(),
                      [&](const auto& one) { return of_client[one.client()] == most; });
}

}  // namespace sightline
