#include "server/metrics/http_connection.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

namespace sightline {
namespace {

// Taken in at a time, so that no connection holds up the others.
constexpr size_t kPiece = 4 << 10;
// What a client may still send after its request. Until it is read, the kernel would reset the connection instead of
// closing it, and the client might lose the answer.
constexpr size_t kMostDiscarded = 256 << 10;

const char* reason_of(int status) {
  switch (status) {
    case 200:
      return "OK";
    case 400:
      return "Bad Request";
    case 404:
      return "Not Found";
    case 405:
      return "Method Not Allowed";
    case 431:
      return "Request Header Fields Too Large";
    case 503:
      return "Service Unavailable";
    default:
      return "Internal Server Error";
  }
}

bool would_wait() {
  return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
}

}  // namespace

HttpConnection::HttpConnection(FileDescriptor fd, std::string client, Time now)
    : fd_(std::move(fd)), client_(std::move(client)), since_(now), deadline_(now + kRequestTime) {}

void HttpConnection::enter(Stage stage, Time now) {
  stage_ = stage;
  deadline_ = now + (stage == Stage::kPage ? kPageTime : stage == Stage::kAnswer ? kAnswerTime : kClosingTime);
}

// poll() reports a connection that is gone in any case.
short HttpConnection::awaited_events() const {
  if (stage_ == Stage::kPage) return 0;
  return stage_ == Stage::kAnswer ? POLLOUT : POLLIN;
}

std::optional<HttpRequest> HttpConnection::advance(Time now) {
  switch (stage_) {
    case Stage::kRequest:
      return read_request(now);
    case Stage::kPage:
      stage_ = Stage::kOver;
      break;  // nothing was awaited, so the connection is gone
    case Stage::kAnswer:
      send(now);
      break;
    case Stage::kClosing:
      discard();
      break;
    case Stage::kOver:
      break;
  }
  return std::nullopt;
}

// Appends to `received_`. False: nothing came.
bool HttpConnection::receive(size_t most) {
  std::array<char, kPiece> piece;
  const ssize_t size = ::recv(fd_.get(), piece.data(), std::min(most, piece.size()), 0);
  if (size > 0) {
    received_.append(piece.data(), static_cast<size_t>(size));
    return true;
  }
  if (size == 0 || !would_wait()) stage_ = Stage::kOver;
  return false;
}

std::optional<HttpRequest> HttpConnection::read_request(Time now) {
  const size_t scanned = received_.size();
  if (!receive(kMostHeadBytes - scanned)) return std::nullopt;
  HttpRequest request;
  const HeadState state = read_request_head(received_, scanned, request);
  if (state == HeadState::kComplete) return request;
  if (state == HeadState::kWrong)
    answer({.status = 400, .body = "This is no request of HTTP/1.\n"}, false, now);
  else if (received_.size() >= kMostHeadBytes)
    answer({.status = 431, .body = "A request has at most " + std::to_string(kMostHeadBytes) + " bytes.\n"}, false,
           now);
  return std::nullopt;
}

void HttpConnection::wait_for_page(uint64_t number, bool head_only, Time now) {
  page_ = number;
  head_only_ = head_only;
  enter(Stage::kPage, now);
}

void HttpConnection::answer(const HttpAnswer& answer, bool head_only, Time now) {
  received_ = {};
  unsent_ = "HTTP/1.1 " + std::to_string(answer.status) + " " + reason_of(answer.status) + "\r\nContent-Type: ";
  unsent_.append(answer.content_type) += "\r\nContent-Length: " + std::to_string(answer.body.size()) +
                                         "\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n";
  if (!head_only) unsent_ += answer.body;
  enter(Stage::kAnswer, now);
  send(now);
}

void HttpConnection::send(Time now) {
  const ssize_t size = ::send(fd_.get(), unsent_.data() + sent_, unsent_.size() - sent_, MSG_NOSIGNAL);
  if (size < 0) {
    if (!would_wait()) stage_ = Stage::kOver;
    return;
  }
  sent_ += static_cast<size_t>(size);
  if (sent_ < unsent_.size()) return;
  unsent_ = {};
  ::shutdown(fd_.get(), SHUT_WR);
  enter(Stage::kClosing, now);
}

void HttpConnection::discard() {
  received_.clear();
  if (receive(kPiece)) discarded_ += received_.size();
  if (discarded_ > kMostDiscarded) stage_ = Stage::kOver;
}

}  // namespace sightline
