#include "server/metrics/http_port.h"

#include <civetweb.h>

#include <exception>
#include <utility>

namespace sightline {
namespace {

// Prometheus and a few probes ask at the same time. A request that does not come in time gives its thread back.
constexpr const char* kThreads = "4";
constexpr const char* kRequestTimeoutMs = "2000";

const char* reason_of(int status) {
  switch (status) {
    case 200: return "OK";
    case 404: return "Not Found";
    case 405: return "Method Not Allowed";
    case 503: return "Service Unavailable";
    default: return "Internal Server Error";
  }
}

// The server's own log would mix with the daemon's. Errors come back as statuses.
int drop_message(const mg_connection*, const char*) {
  return 1;
}

}  // namespace

HttpPort::HttpPort(Pages pages) : pages_(std::move(pages)) {
  mg_init_library(0);
}

HttpPort::~HttpPort() {
  if (context_) mg_stop(context_);
  mg_exit_library();
}

Result<std::unique_ptr<HttpPort>> HttpPort::start(const std::string& address, const std::string& field, Pages pages) {
  std::unique_ptr<HttpPort> made(new HttpPort(std::move(pages)));
  const char* options[] = {"listening_ports", address.c_str(), "num_threads", kThreads, "request_timeout_ms", kRequestTimeoutMs,
                                 "enable_keep_alive", "no", "enable_auth_domain_check", "no", nullptr};
  mg_callbacks callbacks{};
  callbacks.log_message = drop_message;
  made->context_ = mg_start(&callbacks, made.get(), options);
  if (!made->context_) return fail(ErrorCode::kUnavailable, field, "cannot listen at " + address);
  mg_set_request_handler(made->context_, "/", answer, made.get());
  return made;
}

int HttpPort::port() const {
  mg_server_port port{};
  return mg_get_server_ports(context_, 1, &port) == 1 ? port.port : 0;
}

HttpAnswer HttpPort::answer_to(const std::string& method, const std::string& path) const try {
  const auto page = pages_.find(path);
  if (page == pages_.end()) {
    std::string known = "There is no such page. There are:\n";
    for (const auto& [name, make] : pages_) known += name + "\n";
    return {.status = 404, .body = std::move(known)};
  }
  if (method != "GET" && method != "HEAD") return {.status = 405, .body = "Only GET and HEAD are answered.\n"};
  return page->second();
} catch (const std::exception&) {
  return {.status = 500, .body = "The page could not be made.\n"};
}

int HttpPort::answer(mg_connection* connection, void* self) {
  const mg_request_info& request = *mg_get_request_info(connection);
  const std::string method = request.request_method;
  const HttpAnswer answer = static_cast<const HttpPort*>(self)->answer_to(method, request.local_uri);
  mg_printf(connection,
            "HTTP/1.1 %d %s\r\nContent-Type: %s\r\nContent-Length: %zu\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n",
            answer.status, reason_of(answer.status), answer.content_type.c_str(), answer.body.size());
  if (method != "HEAD") mg_write(connection, answer.body.data(), answer.body.size());
  return answer.status;
}

}  // namespace sightline
