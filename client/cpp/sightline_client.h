// The C++ client library of Sightline: what a game server links to talk to a daemon. Link `sightline_client`. Messages
// are the generated ones of proto/sightline/v1, errors are values (server/base/error.h), and nothing throws.
//
//   auto client = Client::connect("127.0.0.1:50151", std::chrono::seconds(5));
//   if (!client) return tl::unexpected(client.error());
//   auto scene = client->upload_scene(bytes, std::chrono::minutes(1));     // once for each scene
//   auto session = client->open_session(open, std::chrono::seconds(10));   // once for each camera
//   if (!session) return tl::unexpected(session.error());
//   if (auto sent = (*session)->send(tick); !sent) return sent;            // every tick; never blocks
//   (*session)->change(settings);                                          // when the game wants another shot
//   auto event = (*session)->receive(std::chrono::milliseconds(5));        // or a handler: see open_session
//
// Threads: any number of threads may use a Client at once. On a session, one thread at a time may send and one other
// may receive. Lifetime: a session keeps its connection alive, so the Client may be destroyed first.
//
// An Error from the server has the code of its gRPC status. `field` is the first field path of its
// google.rpc.BadRequest ("open.targets[1].weight"), and `message` says what is wrong with that field. When a deadline
// passes, the error is kUnavailable with the field "deadline". When the server does not accept the client's
// credentials, it is kFailedPrecondition with the field "credentials". When a server cannot be reached, it is
// kUnavailable with the field "address".
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

// The address on which `sightlined` listens by default.
inline constexpr const char* kDefaultAddress = "127.0.0.1:50151";

// The messages of a server on an open session. A TickError means that nothing of one tick was applied; the session goes
// on.
using SessionEvent = std::variant<v1::CameraReply, v1::TickError, v1::Drain>;

// The Error that a failed call with this cause would return; for logs.
Error to_error(const v1::TickError& error);

class ClientSession {
 public:
  // Called on a thread of gRPC for every event in order, one call at a time. The last call has an Error and means that
  // the stream has ended (kUnavailable with the field "session" when it was closed normally). A handler may send. It
  // must not block and must not destroy the session.
  using Handler = std::function<void(const Result<SessionEvent>&)>;

  // `send` refuses a tick when kMaxUnsent ticks wait for the connection. When kMaxUnread events wait for `receive`, the
  // oldest is dropped: a game needs the newest pose, not all of them.
  static constexpr size_t kMaxUnsent = 256;
  static constexpr size_t kMaxUnread = 256;

  ~ClientSession();  // cancels the stream if it is still open, and waits until no handler runs
  ClientSession(const ClientSession&) = delete;
  ClientSession& operator=(const ClientSession&) = delete;

  // The server's answer to the open request: session id, revision of the scene, warnings.
  const v1::SessionOpened& opened() const { return opened_; }

  // Queues one tick and returns at once. kResourceExhausted (field "tick") when kMaxUnsent ticks wait; nothing is
  // queued then. After the stream has ended: the error that ended it.
  Status send(const v1::Tick& tick);

  // Changes settings, tuning or limits of the session with the next tick that is sent. They act like the fields of
  // these names in that tick: every field that is set replaces the session's value. A preset resets settings and tuning
  // first. Several changes before one tick apply in order, then the tick's own fields. When the tick is refused, so are
  // its changes, and the TickError names the field ("tick.settings...."). Must be called on the thread that sends.
  void change(const v1::Settings& settings);
  void change(const tuning::v1alpha1::Tuning& tuning);
  void change(const v1::CameraLimits& limits);

  // The oldest unread event, or nothing when none came within `timeout` (0: do not wait). An Error when the stream has
  // ended and all events are read. A session with a handler has no events here.
  Result<std::optional<SessionEvent>> receive(std::chrono::nanoseconds timeout);

  // Number of events that were dropped because they were not received in time.
  size_t dropped_events() const;

  // Ends the session in order: no more ticks follow, the server answers those that it has, and the stream ends. Answers
  // that arrive until then can still be received. After `timeout` the stream is cancelled, and the result is
  // kUnavailable.
  Status close(std::chrono::nanoseconds timeout);

 private:
  friend class Client;
  class Stream;
  ClientSession(std::unique_ptr<Stream> stream, v1::SessionOpened opened);

  std::unique_ptr<Stream> stream_;
  v1::SessionOpened opened_;
};

// How a client detects a server that hangs or whose host is gone. After `time` without a byte it sends a ping. After
// `timeout` without an answer, every session on the connection ends with kUnavailable. Servers accept at most one ping
// a second.
struct KeepAlive {
  std::chrono::milliseconds time{10'000};
  std::chrono::milliseconds timeout{5'000};
};

// Identity of the client, and the encryption of its connection. Texts in PEM format.
struct ClientCredentials {
  bool tls = false;              // encrypts TCP
  std::string roots;             // those whose signature makes the server's certificate valid; empty: gRPC's own
  std::string certificate, key;  // what the client shows of itself, for servers that ask for it
  std::string token;             // identifies the client to the server; needs `tls` or a unix socket
};

class Client {
 public:
  // `address`: "host:port" or "unix:/path/to/socket". Waits until the connection is established. Fails with
  // kInvalidArgument, field "token", rather than send a token unencrypted.
  static Result<Client> connect(const std::string& address, std::chrono::nanoseconds timeout,
                                const KeepAlive& keep_alive = {}, const ClientCredentials& credentials = {});

  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  // Sends one .glb, or one .gltf without external files. The hash of the reply goes into SceneRef.hash.
  Result<v1::UploadSceneResponse> upload_scene(std::span<const std::byte> file, std::chrono::nanoseconds timeout);
  // The names of all scenes in the server's scene folder, sorted by bytes; fetches as many pages as there are.
  Result<std::vector<std::string>> list_scenes(std::chrono::nanoseconds timeout);
  // The server's build and configuration, and its counters since its start.
  Result<v1::GetServerInfoResponse> server_info(std::chrono::nanoseconds timeout);
  Result<v1::GetServerStatsResponse> server_stats(std::chrono::nanoseconds timeout);
  // The sessions that are open on the server, with what their cameras show; fetches as many pages as there are.
  Result<std::vector<v1::SessionFigures>> list_sessions(std::chrono::nanoseconds timeout);

  // Opens one session and waits for the server's answer. With a `handler`, events go to it instead of to receive().
  Result<std::unique_ptr<ClientSession>> open_session(const v1::OpenSession& request, std::chrono::nanoseconds timeout,
                                                      ClientSession::Handler handler = nullptr);
  // Goes on with a session that was opened with OpenSession.resumable, and whose stream broke; its `opened()` says what
  // the server has applied. kNotFound with the field "resume.token": the server does not keep it, so a new session must
  // be opened. Camera (camera.h) does all this by itself.
  Result<std::unique_ptr<ClientSession>> resume_session(const v1::ResumeSession& request,
                                                        std::chrono::nanoseconds timeout,
                                                        ClientSession::Handler handler = nullptr);

 private:
  struct Connection;
  Result<std::unique_ptr<ClientSession>> start_session(v1::ControlRequest first, std::chrono::nanoseconds timeout,
                                                       ClientSession::Handler handler);
  explicit Client(std::shared_ptr<Connection> connection);
  std::shared_ptr<Connection> connection_;
};

}  // namespace sightline
