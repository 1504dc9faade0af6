// One connection to the small HTTP server (http_port.h), which carries one request and its answer. Nothing here waits.
//
// Each stage has a time limit from its beginning, however often the client sends or takes a byte.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "server/gate/listening_socket.h"
#include "server/metrics/http_request.h"
#include "server/metrics/page_maker.h"

namespace sightline {

class HttpConnection {
 public:
  using Time = std::chrono::steady_clock::time_point;
  // The connection waits for the request, for a page from the maker, until the client has taken the answer, until the
  // client closes its side.
  enum class Stage { kRequest, kPage, kAnswer, kClosing, kOver };

  static constexpr size_t kMostHeadBytes = 8 << 10;
  static constexpr std::chrono::milliseconds kRequestTime{2000}, kPageTime{5000}, kAnswerTime{5000}, kClosingTime{1000};

  // `fd` is a connected socket that does not block. `client` names its other end.
  HttpConnection(FileDescriptor fd, std::string client, Time now);

  int fd() const { return fd_.get(); }
  const std::string& client() const { return client_; }
  Stage stage() const { return stage_; }
  Time since() const { return since_; }
  Time deadline() const { return deadline_; }
  // For poll().
  short awaited_events() const;

  // Moves what can be moved. Returns the request when its head is complete, once. A head that is wrong or too long is
  // answered here.
  std::optional<HttpRequest> advance(Time now);
  // Page `number` of the maker is to be the answer.
  void wait_for_page(uint64_t number, bool head_only, Time now);
  bool waits_for_page(uint64_t number) const { return stage_ == Stage::kPage && page_ == number; }
  bool head_only() const { return head_only_; }
  void answer(const HttpAnswer& answer, bool head_only, Time now);

 private:
  void enter(Stage stage, Time now);
  bool receive(size_t most);
  std::optional<HttpRequest> read_request(Time now);
  void send(Time now);
  void discard();

  FileDescriptor fd_;
  const std::string client_;
  const Time since_;
  Stage stage_ = Stage::kRequest;
  Time deadline_;
  std::string received_;
  std::string unsent_;
  size_t sent_ = 0;
  size_t discarded_ = 0;
  uint64_t page_ = 0;
  bool head_only_ = false;
};

}  // namespace sightline
