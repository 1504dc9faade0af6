#include "client/cpp/sightline_client.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>

#include "client/cpp/client_error.h"
#include "client/cpp/session_stream.h"
#include "sightline/v1/camera_control.grpc.pb.h"

namespace sightline {
namespace {

// Replies with depth maps are the largest. 32 maps exceed gRPC's default limit of 4 MiB.
constexpr int kMaxReplyBytes = 64 << 20;
constexpr size_t kChunkBytes = 512 << 10;

std::chrono::system_clock::time_point deadline_after(std::chrono::nanoseconds timeout) {
  return std::chrono::system_clock::now() + std::chrono::duration_cast<std::chrono::system_clock::duration>(timeout);
}

void prepare(grpc::ClientContext& context, std::chrono::system_clock::time_point deadline, const std::string& token) {
  context.set_deadline(deadline);
  show_token(context, token);
}

// Asks for one page after the other. `call(context, request, response)` is the RPC, and `items(response)` the list of a
// page.
template <typename Item, typename Request, typename Response, typename Call, typename Items>
Result<std::vector<Item>> all_pages(const std::string& token, std::chrono::nanoseconds timeout, Call call,
                                    Items items) {
  const auto deadline = deadline_after(timeout);
  std::vector<Item> all;
  Request page;
  do {
    grpc::ClientContext context;
    prepare(context, deadline, token);
    Response response;
    const grpc::Status status = call(&context, page, &response);
    if (!status.ok()) return tl::unexpected(error_from_status(status));
    all.insert(all.end(), items(response).begin(), items(response).end());
    page.set_page_token(response.next_page_token());
  } while (!page.page_token().empty());
  return all;
}

}  // namespace

Result<std::shared_ptr<grpc::ChannelCredentials>> channel_credentials(const ClientCredentials& credentials,
                                                                      const std::string& address) {
  const bool local = address.starts_with("unix:");
  if (!credentials.token.empty() && !credentials.tls && !local)
    return invalid("token", "is sent only over TLS or a unix socket");
  if (!credentials.tls || local) return grpc::InsecureChannelCredentials();
  grpc::SslCredentialsOptions options;
  options.pem_root_certs = credentials.roots;
  options.pem_cert_chain = credentials.certificate;
  options.pem_private_key = credentials.key;
  return grpc::SslCredentials(options);
}

struct Client::Connection {
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::CameraControlService::Stub> stub;
  std::string token;
};

Client::Client(std::shared_ptr<Connection> connection) : connection_(std::move(connection)) {}
Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

Result<Client> Client::connect(const std::string& address, std::chrono::nanoseconds timeout,
                               const KeepAlive& keep_alive, const ClientCredentials& credentials) {
  auto encryption = channel_credentials(credentials, address);
  if (!encryption) return tl::unexpected(std::move(encryption.error()));
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMaxReplyBytes);
  const int time_ms = static_cast<int>(keep_alive.time.count());
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, time_ms);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, static_cast<int>(keep_alive.timeout.count()));
  // By default gRPC would ping a paused game's connection only twice, five minutes apart.
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  arguments.SetInt(GRPC_ARG_HTTP2_MIN_SENT_PING_INTERVAL_WITHOUT_DATA_MS, time_ms);
  // A shared pool of subchannels would use the channel arguments of the first client in the process.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  // By default a server that comes up while a client connects is seen a second later.
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  auto channel = grpc::CreateCustomChannel(address, *encryption, arguments);
  if (!channel->WaitForConnected(deadline_after(timeout)))
    return fail(ErrorCode::kUnavailable, "address", "no server answers at " + address);
  auto connection = std::make_shared<Connection>();
  connection->stub = v1::CameraControlService::NewStub(channel);
  connection->channel = std::move(channel);
  connection->token = credentials.token;
  return Client(std::move(connection));
}

Result<v1::UploadSceneResponse> Client::upload_scene(std::span<const std::byte> file,
                                                     std::chrono::nanoseconds timeout) {
  grpc::ClientContext context;
  prepare(context, deadline_after(timeout), connection_->token);
  v1::UploadSceneResponse reply;
  const auto writer = connection_->stub->UploadScene(&context, &reply);
  v1::UploadSceneRequest request;
  for (size_t at = 0; at < file.size(); at += kChunkBytes) {
    const auto chunk = file.subspan(at, std::min(kChunkBytes, file.size() - at));
    request.set_chunk(chunk.data(), chunk.size());
    if (!writer->Write(request)) break;  // the server ended the call; Finish says why
  }
  writer->WritesDone();
  const grpc::Status status = writer->Finish();
  if (!status.ok()) return tl::unexpected(error_from_status(status));
  return reply;
}

Result<std::vector<std::string>> Client::list_scenes(std::chrono::nanoseconds timeout) {
  return all_pages<std::string, v1::ListScenesRequest, v1::ListScenesResponse>(
      connection_->token, timeout, [&](auto&&... of) { return connection_->stub->ListScenes(of...); },
      [](const v1::ListScenesResponse& page) -> const auto& { return page.names(); });
}

Result<v1::GetServerInfoResponse> Client::server_info(std::chrono::nanoseconds timeout) {
  grpc::ClientContext context;
  prepare(context, deadline_after(timeout), connection_->token);
  v1::GetServerInfoResponse info;
  const grpc::Status status = connection_->stub->GetServerInfo(&context, {}, &info);
  if (!status.ok()) return tl::unexpected(error_from_status(status));
  return info;
}

Result<v1::GetServerStatsResponse> Client::server_stats(std::chrono::nanoseconds timeout) {
  grpc::ClientContext context;
  prepare(context, deadline_after(timeout), connection_->token);
  v1::GetServerStatsResponse stats;
  const grpc::Status status = connection_->stub->GetServerStats(&context, {}, &stats);
  if (!status.ok()) return tl::unexpected(error_from_status(status));
  return stats;
}

Result<std::vector<v1::SessionFigures>> Client::list_sessions(std::chrono::nanoseconds timeout) {
  return all_pages<v1::SessionFigures, v1::ListSessionsRequest, v1::ListSessionsResponse>(
      connection_->token, timeout, [&](auto&&... of) { return connection_->stub->ListSessions(of...); },
      [](const v1::ListSessionsResponse& page) -> const auto& { return page.sessions(); });
}

Result<std::unique_ptr<ClientSession>> Client::open_session(const v1::OpenSession& request,
                                                            std::chrono::nanoseconds timeout,
                                                            ClientSession::Handler handler) {
  v1::ControlRequest first;
  *first.mutable_open() = request;
  return start_session(std::move(first), timeout, std::move(handler));
}

Result<std::unique_ptr<ClientSession>> Client::resume_session(const v1::ResumeSession& request,
                                                              std::chrono::nanoseconds timeout,
                                                              ClientSession::Handler handler) {
  v1::ControlRequest first;
  *first.mutable_resume() = request;
  return start_session(std::move(first), timeout, std::move(handler));
}

Result<std::unique_ptr<ClientSession>> Client::start_session(v1::ControlRequest first, std::chrono::nanoseconds timeout,
                                                             ClientSession::Handler handler) {
  auto stream = std::make_unique<ClientSession::Stream>(connection_->channel, connection_->token, std::move(first),
                                                        std::move(handler));
  auto opened = stream->wait_opened(timeout);
  if (!opened) return tl::unexpected(opened.error());
  return std::unique_ptr<ClientSession>(new ClientSession(std::move(stream), std::move(*opened)));
}

ClientSession::ClientSession(std::unique_ptr<Stream> stream, v1::SessionOpened opened)
    : stream_(std::move(stream)), opened_(std::move(opened)) {}
ClientSession::~ClientSession() = default;

Status ClientSession::send(const v1::Tick& tick) {
  return stream_->send(tick);
}
void ClientSession::change(const v1::Settings& settings) {
  stream_->change(settings);
}
void ClientSession::change(const tuning::v1alpha1::Tuning& tuning) {
  stream_->change(tuning);
}
void ClientSession::change(const v1::CameraLimits& limits) {
  stream_->change(limits);
}
Result<std::optional<SessionEvent>> ClientSession::receive(std::chrono::nanoseconds timeout) {
  return stream_->receive(timeout);
}
size_t ClientSession::dropped_events() const {
  return stream_->dropped_events();
}
Status ClientSession::close(std::chrono::nanoseconds timeout) {
  return stream_->close(timeout);
}

}  // namespace sightline
