// A small HTTP server for pages that are made when they are asked for.
//
// It is meant for Prometheus and for probes, on an address that only they can reach: it has neither encryption nor
// authentication. A probe must be answered whatever other clients do, and when all other threads of the daemon hang. So
// the server is one thread that never waits for a client. It has a number of places for connections. When all are
// taken, a new connection gets the place of the oldest one of the client that has most. Servers of libraries give a
// client its place for as long as it sends a byte now and then.
#pragma once

#include <atomic>
#include <chrono>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <thread>

#include "server/base/error.h"
#include "server/gate/listening_socket.h"
#include "server/metrics/http_connection.h"
#include "server/metrics/page_maker.h"

namespace sightline {

struct HttpPage {
  MakePage make;
  // Made by the page maker. The others are made on the server's thread, and must be made at once.
  bool takes_long = false;
};

class HttpPort {
 public:
  using Pages = std::map<std::string, HttpPage>;  // by path: "/metrics"

  static constexpr size_t kMostConnections = 128;

  // Listens at `address`, host:port; port 0 takes a free one. Answers GET and HEAD. What the pages refer to must
  // outlive it. Fails with kUnavailable or kInvalidArgument, field `field`, when the address cannot be used.
  static Result<std::unique_ptr<HttpPort>> start(const std::string& address, const std::string& field, Pages pages);
  // Closes the port, and waits for the page that is being made.
  ~HttpPort();
  HttpPort(const HttpPort&) = delete;
  HttpPort& operator=(const HttpPort&) = delete;

  int port() const { return socket_.port(); }

 private:
  using Time = HttpConnection::Time;
  using Connections = std::list<HttpConnection>;  // the oldest is the first

  HttpPort(ListeningSocket socket, FileDescriptor wake, Pages pages);
  void run();
  void wait();
  void go_round();
  void advance(HttpConnection& connection, Time now);
  void take_pages(Time now);
  void accept(Time now);
  bool many_wait() const;
  Connections::iterator first_to_go();
  void wake() const;

  const ListeningSocket socket_;
  const FileDescriptor wake_;
  const Pages pages_;
  // Used by thread_ only.
  Connections connections_;
  Time accepts_again_{};  // after a pause

  std::atomic<bool> stopping_{false};
  PageMaker maker_;
  std::thread thread_;
};

}  // namespace sightline
