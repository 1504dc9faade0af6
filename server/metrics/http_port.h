// A small HTTP server for pages that are made when they are asked for.
//
// It is meant for Prometheus and for probes, on an address that only they can reach: it has neither encryption nor authentication.
// A few threads of its own answer, so a probe gets its answer even when everything else in the daemon hangs.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "server/base/error.h"

struct mg_connection;
struct mg_context;

namespace sightline {

struct HttpAnswer {
  int status = 200;
  std::string body;
  std::string content_type = "text/plain; charset=utf-8";
};

class HttpPort {
 public:
  // Called on any thread of the server, possibly on several at the same time.
  using Page = std::function<HttpAnswer()>;
  using Pages = std::map<std::string, Page>;  // by path: "/metrics"

  // Listens at `address`, host:port; port 0 takes a free one. Answers GET and HEAD. What the pages refer to must outlive it. Fails with
  // kUnavailable, field `field`, when the address cannot be used.
  static Result<std::unique_ptr<HttpPort>> start(const std::string& address, const std::string& field, Pages pages);
  // Closes the port, and waits for the pages that are being made.
  ~HttpPort();
  HttpPort(const HttpPort&) = delete;
  HttpPort& operator=(const HttpPort&) = delete;

  int port() const;

 private:
  explicit HttpPort(Pages pages);
  static int answer(mg_connection* connection, void* self);
  HttpAnswer answer_to(const std::string& method, const std::string& path) const;

  const Pages pages_;
  mg_context* context_ = nullptr;
};

}  // namespace sightline
