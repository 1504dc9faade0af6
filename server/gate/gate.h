// The gate of the daemon: it accepts all connections, and hands them to gRPC through a relay.
//
// gRPC 1.51 gives up a listening socket for good when file descriptors run out, and limits neither the number of
// connections nor what a client does on one. The gate accepts at most `max_connections` and `max_per_client`, so
// descriptors are left for everything else. A connection on which no call was accepted makes way for a new one. The
// relay (relay.h) cuts connections that flood. With keys, connections over TCP are encrypted; those over a unix socket
// never are.
//
// The price is one more thread on the way of each message.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "server/base/mutex.h"
#include "server/base/token_bucket.h"
#include "server/gate/access.h"
#include "server/gate/connection.h"
#include "server/gate/frame_watch.h"
#include "server/gate/listening_socket.h"
#include "server/gate/relay.h"
#include "server/gate/tls.h"

namespace sightline {

struct GateLimits {
  size_t max_connections = 256;
  size_t max_per_client = 192;  // a client is a user on a unix socket, or an address
  double greeting_s = 10.0;     // time in which a client must begin to speak HTTP/2
  // a connection without part of a call for this time may make way for a new one, even if a call was accepted
  double idle_s = 60.0;
  // TLS handshakes of one client at once, and how many more each second.
  double handshakes_burst = 256.0, handshakes_per_s = 32.0;
  // For this time after a connection was cut for a flood, its client gets as many new ones at once, and as many more
  // each second.
  double after_flood_s = 10.0, after_flood_burst = 4.0, after_flood_per_s = 2.0;
  FrameLimits frames;
  // Of what gRPC holds of messages that are not complete, or that nobody has taken yet, in bytes: of all clients, and
  // half of it for one. Beyond it the connection that holds most is cut. 0: no limit.
  size_t held_bytes = 0;
};

// Since the start, except `open`.
struct GateCounts {
  uint64_t open = 0, accepted = 0;
  uint64_t refused = 0;         // no place was left
  uint64_t refused_client = 0;  // those of `refused` whose client had all that a client may have
  uint64_t cut = 0;             // for what the client sent, or for silence
  uint64_t received_bytes = 0, sent_bytes = 0;
  uint64_t failed_handshakes = 0;  // of those that were cut
};

// Thread-safe.
class Gate {
 public:
  // Gets a connected socket that does not block.
  using HandOver = std::function<void(FileDescriptor)>;
  // A connection was refused or cut. Runs on a thread of the gate and must return at once.
  using Notice = std::function<void(const std::string& client, std::string_view reason)>;

  // `relays` threads move bytes; one is enough for hundreds of sessions. `tls` must outlive the gate; null: nothing is
  // encrypted.
  Gate(std::vector<ListeningSocket> sockets, const GateLimits& limits, unsigned relays, const TlsKeys* tls,
       HandOver hand_over, Notice notice);
  // Closes everything.
  ~Gate();
  Gate(const Gate&) = delete;
  Gate& operator=(const Gate&) = delete;

  // Starts to accept. Once.
  void start();
  // Stops to listen, and removes the socket files. Open connections go on.
  void stop_accepting();

  // What is known of a client, from ServerContext::peer() of one of its calls. If the connection is gone, its name is
  // the argument.
  Peer peer_of(const std::string& peer) const;
  // A call on this connection was accepted from a caller who may make it. Until then the connection makes way for
  // others.
  void note_accepted(const std::string& peer) const;
  GateCounts counts() const;
  // Time since the slowest of the gate's threads last went round, in seconds. Each does so at least four times a
  // second, unless it hangs.
  double silent_s() const;

 private:
  void run();
  bool accept_from(const ListeningSocket& socket);
  void admit(FileDescriptor fd, bool encrypted);
  bool may_shake_hands(const std::string& client);
  void note_flood(const std::string& client);
  std::shared_ptr<ClientFlow> flow_of(const std::string& client);
  void enter(const std::shared_ptr<Connection>& connection);
  void tell(const std::string& client, std::string_view reason) noexcept;
  bool may_connect(const std::string& client);
  void refuse(const std::string& client, std::string_view reason);
  bool make_room(const std::string& client);
  std::shared_ptr<Connection> least_needed(const std::string& client) const NEEDS(mutex_);
  void note_held(const Connection& connection, ptrdiff_t change);
  void limit_held();
  std::shared_ptr<Connection> largest_holder() const;
  void cut_overdue();
  void cut(const std::shared_ptr<Connection>& connection, std::string_view reason);
  std::shared_ptr<Connection> connect_to_grpc(FileDescriptor outer, std::string client, bool encrypted);
  void over(const std::shared_ptr<Connection>& connection, std::string_view reason);

  const GateLimits limits_;
  const TlsKeys* const tls_;
  const HandOver hand_over_;
  const Notice notice_;
  std::vector<ListeningSocket> sockets_;  // used by thread_ only, until it has ended
  const FileDescriptor wake_;
  std::atomic<size_t> next_relay_{0};
  std::map<std::string, TokenBucket> handshakes_;  // by client; used by thread_ only
  std::atomic<double> beat_s_{gate_now_s()};       // when the thread last went round
  std::atomic<size_t> held_bytes_{0};              // of all connections: see Connection::held_bytes

  mutable Mutex mutex_;
  // By peer. Those that were cut are no longer in it, so their sockets are open here or nowhere.
  std::map<std::string, std::shared_ptr<Connection>> connections_ GUARDED(mutex_);
  std::map<std::string, size_t> of_client_ GUARDED(mutex_);
  struct Flood {
    TokenBucket connections;
    double last_s;  // when a connection of the client was cut last
  };
  std::map<std::string, Flood> floods_ GUARDED(mutex_);                       // by client
  std::map<std::string, std::shared_ptr<ClientFlow>> flows_ GUARDED(mutex_);  // by client
  GateCounts counts_ GUARDED(mutex_);
  bool stopping_ GUARDED(mutex_) = false;

  std::vector<std::unique_ptr<Relay>> relays_;
  std::unique_ptr<Relay> greeter_;  // null without TLS
  std::thread thread_;
};

}  // namespace sightline
