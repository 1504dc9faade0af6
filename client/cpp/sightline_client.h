// The C++ client of Sightline: what a game server links to talk to a daemon. Link `sightline_client`;
// messages are the generated ones of proto/sightline/v1, errors are values (server/base/error.h), nothing
// throws.
//
//   auto client = Client::connect("127.0.0.1:50151", std::chrono::seconds(5));
//   auto scene = client->upload_scene(bytes, std::chrono::minutes(1));       // once per scene
//   auto session = client->open_session(open, std::chrono::seconds(10));     // once per camera
//   session->send(tick);                                                     // every tick, never blocks
//   session->change(settings);                                               // when the game wants another shot
//   auto event = session->receive(std::chrono::milliseconds(5));             // or a handler, see
//   open_session
//
// Threads: Client may be used from any number of threads at once. One thread at a time may send on a session
// and one other may receive. Lifetime: a session keeps its connection alive by itself, the Client may go
// first.
//
// An Error that the server sent has the code of its gRPC status, the first field path of its
// google.rpc.BadRequest
// ("open.targets[1].weight") in `field` and what is wrong with that field in `message`. A deadline that
// passes and a server that cannot be reached are kUnavailable with field "deadline" and "address".
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "server/base/error.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Where `sightlined` listens unless told otherwise.
inline constexpr const char* kDefaultAddress = "127.0.0.1:50151";

// What a server says on an open session. A Rejection means that nothing of one tick was applied and the
// session lives on.
using SessionEvent = std::variant<v1::CameraReply, v1::TickError, v1::Drain>;

// The same Error that a failed call would give, for logs.
Error to_error(const v1::TickError& rejection);

class ClientSession {
 public:
  // Called on a thread of gRPC, one call at a time, for every event in order and at last once with an Error
  // when the stream has ended (code kUnavailable, field "session", when it was closed in order). Must not
  // block, and must not destroy the session; it may send.
  using Handler = std::function<void(const Result<SessionEvent>&)>;

  // Ticks that wait for the connection before `send` refuses more, and events that wait for `receive` before
  // the oldest is dropped: a game wants the newest pose, not all of them.
  static constexpr size_t kMaxUnsent = 256;
  static constexpr size_t kMaxUnread = 256;

  ~ClientSession();  // cancels the stream when it is still open, and waits until no handler runs
  ClientSession(const ClientSession&) = delete;
  ClientSession& operator=(const ClientSession&) = delete;

  // What the server answered to the open request: session id, mirror revision, warnings.
  const v1::SessionOpened& opened() const { return opened_; }

  // Queues one tick and returns. kResourceExhausted (field "tick"): kMaxUnsent ticks wait, nothing was
  // queued; the error that ended the stream when it has ended.
  Status send(const v1::Tick& tick);

  // Changes settings, tuning or limits of the running session with the next tick that is sent, as the fields of the same names of that
  // tick would: what is sent is put over what the session has; with settings.preset it starts anew from that preset. Several
  // changes before one tick add up in order; what that tick itself sends comes last. When that tick is refused its changes
  // are refused with it: the Rejection names the field, "tick.settings....". Called on the thread that sends.
  void change(const v1::Settings& settings);
  void change(const tuning::v1alpha1::Tuning& tuning);
  void change(const v1::CameraLimits& limits);

  // The next event, oldest first; empty when none came within `timeout` (0: only what is there). An Error
  // when the stream has ended and all events are read. With a handler set, events never come here.
  Result<std::optional<SessionEvent>> receive(std::chrono::nanoseconds timeout);

  // Events dropped because nobody received them.
  size_t dropped_events() const;

  // Says that no more ticks come, lets the server answer those that it has, and waits for the end of the
  // stream. Answers that come until then can still be received. After `timeout` the stream is cancelled:
  // kUnavailable.
  Status close(std::chrono::nanoseconds timeout);

 private:
  friend class Client;
  class Stream;
  ClientSession(std::unique_ptr<Stream> stream, v1::SessionOpened opened);

  std::unique_ptr<Stream> stream_;
  v1::SessionOpened opened_;
};

// A server that hangs or whose host is gone, as a client finds it out: after `time` without a byte it is pinged, and
// after `timeout` without an answer every session on the connection ends with kUnavailable. Servers take pings once a
// second, not more often.
struct KeepAlive {
  std::chrono::milliseconds time{10'000};
  std::chrono::milliseconds timeout{5'000};
};

class Client {
 public:
  // `address`: "host:port" or "unix:/path/to/socket". Waits until a connection stands.
  static Result<Client> connect(const std::string& address, std::chrono::nanoseconds timeout,
                                const KeepAlive& keep_alive = {});

  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  // Sends one .glb, or one .gltf without external files, in chunks. The answer's hash goes into
  // SceneRef.hash.
  Result<v1::UploadSceneResponse> upload_scene(std::span<const std::byte> file,
                                            std::chrono::nanoseconds timeout);
  // The names of all scenes in the server's scene folder, sorted by bytes; fetches as many pages as there are.
  Result<std::vector<std::string>> list_scenes(std::chrono::nanoseconds timeout);
  // What the server is, and what it has done since its start.
  Result<v1::GetServerInfoResponse> server_info(std::chrono::nanoseconds timeout);
  Result<v1::GetServerStatsResponse> server_stats(std::chrono::nanoseconds timeout);

  // Opens one session and waits for the server's answer. With `handler`, events go there instead of to
  // receive().
  Result<std::unique_ptr<ClientSession>> open_session(const v1::OpenSession& request,
                                                      std::chrono::nanoseconds timeout,
                                                      ClientSession::Handler handler = nullptr);

 private:
  struct Connection;
  explicit Client(std::shared_ptr<Connection> connection);
  std::shared_ptr<Connection> connection_;
};

}  // namespace sightline
