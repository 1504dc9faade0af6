// What the gate knows of one connection, and who is at its other end.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "server/base/mutex.h"
#include "server/gate/access.h"
#include "server/gate/frame_watch.h"
#include "server/gate/listening_socket.h"
#include "server/gate/tls.h"

namespace sightline {

// Who is at the other end of an accepted socket: the user on a unix socket ("uid 1000", from the kernel), otherwise the
// address. An IPv6 client has a whole /64 to choose from, so that is its name.
std::string client_of_socket(int fd);
// The numeric id of the user on a unix socket.
std::optional<unsigned> user_of_socket(int fd);

// The time of the gate's clock: monotonic, in seconds.
double gate_now_s();

// One connection: the client's socket, and the gate's end of the socket pair whose other end gRPC has. Made by the
// gate's thread; afterwards only the members that say so change.
struct Connection {
  FileDescriptor outer, inner;
  std::string client;            // see client_of_socket
  std::optional<unsigned> user;  // see user_of_socket
  std::string peer;              // what gRPC calls it: ServerContext::peer()
  double since_s = 0.0;
  std::shared_ptr<ClientFlow> flow;  // of the client, on all its connections

  // Used by the relay's thread. Null: the connection is not encrypted.
  std::unique_ptr<TlsStream> tls;
  // What `tls` knew of the client after the handshake. From any thread; empty before.
  std::string certificate() const;
  void set_certificate(std::string name);

  // Written by the relay's thread, read by the gate's.
  std::atomic<uint64_t> calls{0};
  std::atomic<double> last_call_s{0.0};
  // The connection is cut when this time has passed. At first it is the time in which the client must greet.
  std::atomic<double> deadline_s{0.0};
  std::atomic<bool> handshake_failed{false};
  std::atomic<bool> flooded{false};   // it was cut because the client sent too much
  std::atomic<size_t> held_bytes{0};  // see FrameWatch::held_bytes
  // Written by any thread.
  std::atomic<bool> accepted{false};  // a call on it was accepted from a caller who may make it

 private:
  mutable Mutex mutex_;
  std::string certificate_ GUARDED(mutex_);
};

}  // namespace sightline
