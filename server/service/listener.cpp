#include "server/service/listener.h"

#include <grpc/grpc.h>
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <future>
#include <utility>

#include "server/service/answer_timeout.h"
#include "sightline/v1/camera_control.grpc.pb.h"

namespace sightline {
namespace {

// Bounds how far one client can fill the server's queues.
// How much larger than allowed a message may be to be refused by us.
constexpr size_t kRoomToRefuse = size_t{1} << 20;
constexpr int kMaxCallsPerConnection = 1024;
// Synchronous RPCs occupy one thread each.
constexpr int kMaxThreads = 64;
// A busy thread may be silent for so many times as long as one that waits for something.
constexpr int kPatienceWithBusy = 6;
// How often calls are cancelled that are still open after the server's end.
constexpr std::chrono::milliseconds kCancelPeriod{100};

// The sockets that the options name.
Result<std::vector<ListeningSocket>> listening_sockets(const ListenOptions& options) {
  std::vector<ListeningSocket> sockets;
  const auto take = [&](Result<ListeningSocket> socket) -> Status {
    if (!socket) return tl::unexpected(std::move(socket.error()));
    sockets.push_back(std::move(*socket));
    return {};
  };
  Status status;
  if (!options.tcp.empty()) status = take(ListeningSocket::tcp(options.tcp));
  if (status && !options.unix_path.empty())
    status = take(ListeningSocket::unix_file(options.unix_path, options.unix_mode));
  if (!status) return tl::unexpected(std::move(status.error()));
  return sockets;
}

// Nobody shall open a daemon to a network without noticing.
Status check_exposure(const std::string& address, bool stays_on_host, const ListenOptions& options) {
  const bool safe = options.tls && options.callers_are_known;
  if (safe || options.allow_insecure_network || stays_on_host) return {};
  return fail(ErrorCode::kFailedPrecondition, "--listen",
              address +
                  " can be reached from other hosts, so it needs --tls-cert with --tls-client-ca or --access-file; "
                  "--allow-insecure-network opens it to everyone");
}

void configure(grpc::ServerBuilder& builder, const ListenOptions& options) {
  // gRPC's own refusal does not name the flag, and the daemon does not learn of it. So a message that is a little too
  // large gets through to ControlStream, which refuses it. gRPC refuses a far larger one by its announced length, and
  // takes none of it in.
  builder.SetMaxReceiveMessageSize(static_cast<int>(options.max_message_bytes + kRoomToRefuse));
  // A compressed message is unpacked before its size is checked, so half a megabyte can take half a gigabyte.
  builder.AddChannelArgument(GRPC_COMPRESSION_CHANNEL_ENABLED_ALGORITHMS_BITSET, 1 << GRPC_COMPRESS_NONE);
  // No bandwidth probe: with it a client could send 4 MB ahead, which is seconds of ticks; without it 64 KB.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_BDP_PROBE, 0);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, kMaxCallsPerConnection);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, static_cast<int>(options.keepalive_time.count()));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, static_cast<int>(options.keepalive_timeout.count()));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // Clients may ping once a second.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 1'000);
  // The synchronous RPCs are rare, so one queue is enough for them.
  builder.SetSyncServerOption(grpc::ServerBuilder::SyncServerOption::NUM_CQS, 1);
  grpc::ResourceQuota quota("listener");
  builder.SetResourceQuota(quota.SetMaxThreads(kMaxThreads));
}

// A loop that works, or waits for a processor, is slow: a restart would end all sessions, and the next daemon would not
// be faster. It hangs only if it works for ever.
std::chrono::duration<double> weighed(const EventLoop::Silence& silence) {
  return std::max<std::chrono::duration<double>>(silence.lasted - silence.busy, silence.lasted / kPatienceWithBusy);
}

}  // namespace

Status Listener::check(const ListenOptions& options) {
  if (options.tcp.empty() && options.unix_path.empty())
    return invalid("--listen", "there is no address to listen at: give --listen or --listen-unix");
  if (!options.tcp.empty()) {
    const auto stays_on_host = ListeningSocket::stays_on_host(options.tcp, "--listen");
    if (!stays_on_host) return tl::unexpected(stays_on_host.error());
    if (Status ok = check_exposure(options.tcp, *stays_on_host, options); !ok) return ok;
  }
  return options.unix_path.empty() ? Status{} : ListeningSocket::check_unix_path(options.unix_path);
}

Result<std::unique_ptr<Listener>> Listener::start(const ListenOptions& options, CameraControlService& service) {
  if (Status ok = check(options); !ok) return tl::unexpected(std::move(ok.error()));
  auto sockets = listening_sockets(options);
  if (!sockets) return tl::unexpected(std::move(sockets.error()));
  for (const ListeningSocket& socket : *sockets)
    if (Status ok = check_exposure(socket.address(), socket.stays_on_host(), options); !ok)
      return tl::unexpected(std::move(ok.error()));
  std::unique_ptr<Listener> listener(new Listener);
  for (const ListeningSocket& socket : *sockets) {
    listener->addresses_.push_back(socket.address());
    listener->port_ = std::max(listener->port_, socket.port());
  }
  grpc::ServerBuilder builder;
  configure(builder, options);
  builder.RegisterService(&service);
  builder.RegisterService(&listener->health_);
  listener->reflection_.register_at(builder);
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> interceptors;
  interceptors.push_back(answer_timeouts(service.timers()));
  builder.experimental().SetInterceptorCreators(std::move(interceptors));
  using Acceptor = grpc::ServerBuilder::experimental_type::ExternalConnectionType;
  std::shared_ptr<grpc::experimental::ExternalConnectionAcceptor>
      acceptor = builder.experimental().AddExternalConnectionAcceptor(Acceptor::FROM_FD,
                                                                      grpc::InsecureServerCredentials());
  std::vector<std::unique_ptr<grpc::ServerCompletionQueue>> queues;
  for (unsigned i = 0; i < std::max(options.loops, 1u); ++i) queues.push_back(builder.AddCompletionQueue());
  std::unique_ptr<grpc::ServerCompletionQueue> of_health = builder.AddCompletionQueue();
  listener->server_ = builder.BuildAndStart();
  if (!listener->server_) {
    for (const auto& queue : queues) queue->Shutdown();
    of_health->Shutdown();
    return fail(ErrorCode::kInternal, "", "gRPC did not start");
  }
  listener->gate_ = std::make_unique<Gate>(
      std::move(*sockets), options.gate, options.loops, options.tls,
      [acceptor](FileDescriptor fd) {
        grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters connection;
        connection.fd = fd.release();
        acceptor->HandleNewConnection(&connection);
      },
      options.on_refused);
  service.callers().come_through(*listener->gate_);
  for (auto& queue : queues) {
    listener->loops_.push_back(std::make_unique<EventLoop>(std::move(queue)));
    service.take_calls(*listener->loops_.back());
  }
  listener->health_.limit_watches_by(
      options.max_health_watches,
      [gate = listener->gate_.get()](const grpc::ServerContext& context) {
        return gate->peer_of(context.peer()).client;
      },
      [&service] { service.limit_counts().hit(Limit::kHealthWatches); });
  listener->health_loop_ = std::make_unique<EventLoop>(std::move(of_health), std::chrono::steady_clock::now, "health");
  listener->health_.take_calls(*listener->health_loop_);
  listener->reflection_.admit_by([&service](const grpc::ServerContext& context) {
    const auto caller = service.callers().identify(context, Need::kAnyRole);
    return caller ? grpc::Status::OK : caller.error();
  });
  listener->reflection_.limit_calls_to(options.max_reflection_calls,
                                       [&service] { service.limit_counts().hit(Limit::kReflectionCalls); });
  listener->reflection_.take_calls(
      *listener->loops_.front(), service.timers(),
      {v1::CameraControlService::service_full_name(), grpc::health::v1::Health::service_full_name()});
  listener->set_alive(true);
  listener->set_serving(true);
  listener->gate_->start();
  return listener;
}

Listener::~Listener() {
  if (server_) stop(std::chrono::milliseconds(0));
}

void Listener::set_serving(bool serving) {
  health_.set(v1::CameraControlService::service_full_name(), serving);
  health_.set("", serving);
  health_.set("readiness", serving);
}

void Listener::set_alive(bool alive) {
  health_.set("liveness", alive);
}

std::chrono::duration<double> Listener::loops_silent() const {
  std::chrono::duration<double> longest(0.0);
  for (const auto& loop : loops_) longest = std::max(longest, weighed(loop->silence()));
  return std::max(longest, weighed(health_loop_->silence()));
}

// Shutdown has a deadline of its own, for which gRPC waits by the wall clock (server/rpc/timers.h). A call that begins
// while the server shuts down may slip through, so they are cancelled again and again.
void Listener::shut_down(std::chrono::milliseconds grace) {
  const std::future<void> down = std::async(std::launch::async, [this] { server_->Shutdown(); });
  for (auto patience = grace; down.wait_for(patience) != std::future_status::ready; patience = kCancelPeriod)
    grpc_server_cancel_all_calls(server_->c_server());
}

void Listener::stop(std::chrono::milliseconds grace) {
  gate_->stop_accepting();
  health_.end_watches();
  shut_down(grace);
  server_->Wait();
  loops_.clear();
  health_loop_.reset();
}

}  // namespace sightline
