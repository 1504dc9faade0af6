#include "server/service/listener.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "sightline/v1/camera_control.grpc.pb.h"

namespace sightline {
namespace {

// Bounds how far one client can fill the server's queues.
constexpr int kMaxCallsPerConnection = 1024;
// Synchronous RPCs occupy one thread each.
constexpr int kMaxThreads = 64;

Result<sockaddr_un> socket_address(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) {
    return invalid("--listen-unix", "a socket path has at most " +
                                        std::to_string(sizeof(address.sun_path) - 1) + " bytes: " + path);
  }
  std::memcpy(address.sun_path, path.c_str(), path.size());
  return address;
}

// The errno of connecting; 0 when a process serves the socket.
int try_to_connect(const sockaddr_un& address) {
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return errno;
  const int result = ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
  const int error = result == 0 ? 0 : errno;
  ::close(fd);
  return error;
}

// Removes a stale socket file. gRPC itself would replace any file at the path.
Status make_way_for_socket(const std::string& path) {
  const auto address = socket_address(path);
  if (!address) return tl::unexpected(address.error());
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0) return {};
  if (!S_ISSOCK(info.st_mode)) return invalid("--listen-unix", path + " exists and is not a socket");
  if (const int error = try_to_connect(*address); error != ECONNREFUSED) {
    const std::string why =
        error == 0 || error == EAGAIN ? "another process serves it" : std::strerror(error);
    return fail(ErrorCode::kUnavailable, "--listen-unix", path + ": " + why);
  }
  if (::unlink(path.c_str()) != 0) {
    return fail(ErrorCode::kUnavailable, "--listen-unix", path + ": " + std::strerror(errno));
  }
  return {};
}

void configure(grpc::ServerBuilder& builder, const ListenOptions& options) {
  builder.SetMaxReceiveMessageSize(static_cast<int>(options.max_message_bytes));
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  // No bandwidth probe: with it a client could send 4 MB ahead, which is seconds of ticks; without it 64 KB.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_BDP_PROBE, 0);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, kMaxCallsPerConnection);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, static_cast<int>(options.keepalive_time.count()));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS,
                             static_cast<int>(options.keepalive_timeout.count()));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // Clients may ping once a second.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 1'000);
  // The synchronous RPCs are rare, so one queue is enough for them.
  builder.SetSyncServerOption(grpc::ServerBuilder::SyncServerOption::NUM_CQS, 1);
  builder.SetResourceQuota(grpc::ResourceQuota("listener").SetMaxThreads(kMaxThreads));
}

}  // namespace

Result<std::unique_ptr<Listener>> Listener::start(const ListenOptions& options,
                                                  CameraControlService& service) {
  if (options.tcp.empty() && options.unix_path.empty()) return invalid("--listen", "there is no address to listen at: give --listen or --listen-unix");
  std::unique_ptr<Listener> listener(new Listener);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder builder;
  configure(builder, options);
  builder.RegisterService(&service);
  builder.RegisterService(&listener->health_);

  int port = 0;
  if (!options.tcp.empty()) builder.AddListeningPort(options.tcp, grpc::InsecureServerCredentials(), &port);
  if (!options.unix_path.empty()) {
    if (const Status status = make_way_for_socket(options.unix_path); !status)
      return tl::unexpected(status.error());
    builder.AddListeningPort("unix:" + options.unix_path, grpc::InsecureServerCredentials());
  }
  std::vector<std::unique_ptr<grpc::ServerCompletionQueue>> queues;
  for (unsigned i = 0; i < std::max(options.loops, 1u); ++i) queues.push_back(builder.AddCompletionQueue());
  // The umask makes sure that the socket never has wider permissions than its mode.
  const mode_t former_umask = ::umask(0777 & ~options.unix_mode);
  listener->server_ = builder.BuildAndStart();
  ::umask(former_umask);
  if (!listener->server_) {
    for (const auto& queue : queues) queue->Shutdown();
    const bool tcp_failed = !options.tcp.empty() && port == 0;
    return fail(ErrorCode::kUnavailable, tcp_failed ? "--listen" : "--listen-unix",
                "cannot listen at " + (tcp_failed ? options.tcp : options.unix_path) +
                    ": the address is in use or not valid on this machine");
  }
  listener->port_ = port;
  if (port != 0)
    listener->addresses_.push_back(options.tcp.substr(0, options.tcp.rfind(':') + 1) + std::to_string(port));
  if (!options.unix_path.empty()) listener->addresses_.push_back("unix:" + options.unix_path);
  for (auto& queue : queues) {
    listener->loops_.push_back(std::make_unique<EventLoop>(std::move(queue)));
    service.take_calls(*listener->loops_.back());
  }
  listener->health_.take_calls(*listener->loops_.front());
  listener->set_serving(true);
  return listener;
}

Listener::~Listener() {
  if (server_) stop(std::chrono::milliseconds(0));
}

void Listener::set_serving(bool serving) {
  health_.set(v1::CameraControlService::service_full_name(), serving);
  health_.set("", serving);
}

void Listener::set_not_serving() {
  set_serving(false);
}

void Listener::stop(std::chrono::milliseconds grace) {
  health_.end_watches();
  server_->Shutdown(std::chrono::system_clock::now() + grace);
  server_->Wait();
  loops_.clear();
}

}  // namespace sightline
