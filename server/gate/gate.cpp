#include "server/gate/gate.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <new>
#include <tuple>
#include <utility>

namespace sightline {
namespace {

// How often connections are checked for their deadlines.
constexpr int kCheckMs = 250;
// After an accept that failed for want of descriptors or memory; without the pause the thread would spin.
constexpr std::chrono::milliseconds kAfterFailure{20};
// Of each end of a socket pair. More would only hide messages from gRPC's flow control.
constexpr int kPairBytes = 64 << 10;

// Gives a socket a name of its own in the kernel's abstract namespace, by which gRPC then calls its peer.
std::string name_socket(int fd) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(sa_family_t)) != 0) return {};
  socklen_t length = sizeof(address);
  if (::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length) != 0) return {};
  const size_t size = length - offsetof(sockaddr_un, sun_path);
  return size > 1 ? "unix-abstract:" + std::string(address.sun_path + 1, size - 1) : std::string{};
}

}  // namespace

Gate::Gate(std::vector<ListeningSocket> sockets, const GateLimits& limits, unsigned relays, const TlsKeys* tls,
           HandOver hand_over, Notice notice)
    : limits_(limits),
      tls_(tls),
      hand_over_(std::move(hand_over)),
      notice_(std::move(notice)),
      sockets_(std::move(sockets)),
      wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  const auto over_here = [this](const auto& connection, std::string_view reason) {
    if (connection->flooded) note_flood(connection->client);
    over(connection, reason);
  };
  const auto holds = [this](const Connection& connection, ptrdiff_t change) { note_held(connection, change); };
  for (unsigned i = 0; i < std::max(relays, 1u); ++i)
    relays_.push_back(std::make_unique<Relay>(limits_.frames, over_here, holds));
  if (!tls_) return;
  greeter_ = std::make_unique<Relay>(limits_.frames, over_here, holds);
  greeter_->pass_on_to([this]() -> Relay& { return *relays_[next_relay_++ % relays_.size()]; });
}

Gate::~Gate() {
  stop_accepting();
  greeter_.reset();
  relays_.clear();
}

void Gate::start() {
  thread_ = std::thread([this] { run(); });
}

void Gate::stop_accepting() {
  {
    const MutexLock lock(mutex_);
    if (std::exchange(stopping_, true)) return;
  }
  ::eventfd_write(wake_.get(), 1);
  if (thread_.joinable()) thread_.join();
  sockets_.clear();
}

Peer Gate::peer_of(const std::string& peer) const {
  const MutexLock lock(mutex_);
  const auto found = connections_.find(peer);
  if (found == connections_.end()) return {peer, std::nullopt, {}, false};
  const Connection& connection = *found->second;
  return {.client = connection.client,
          .user = connection.user,
          .certificate = connection.certificate(),
          .confidential = connection.tls != nullptr || connection.user.has_value()};
}

void Gate::note_accepted(const std::string& peer) const {
  const MutexLock lock(mutex_);
  const auto found = connections_.find(peer);
  if (found != connections_.end()) found->second->accepted = true;
}

GateCounts Gate::counts() const {
  const MutexLock lock(mutex_);
  GateCounts counts = counts_;
  counts.open = connections_.size();
  for (const auto& relay : relays_) {
    counts.received_bytes += relay->received_bytes();
    counts.sent_bytes += relay->sent_bytes();
  }
  return counts;
}

double Gate::silent_s() const {
  double oldest_s = gate_now_s();
  {
    const MutexLock lock(mutex_);
    if (!stopping_) oldest_s = beat_s_.load(std::memory_order_relaxed);
  }
  for (const auto& relay : relays_) oldest_s = std::min(oldest_s, relay->last_beat_s());
  if (greeter_) oldest_s = std::min(oldest_s, greeter_->last_beat_s());
  return std::max(0.0, gate_now_s() - oldest_s);
}

void Gate::run() {
  ::prctl(PR_SET_NAME, "gate");  // for ps and debuggers
  std::vector<pollfd> watched{{wake_.get(), POLLIN, 0}};
  for (const ListeningSocket& socket : sockets_) watched.push_back({socket.fd(), POLLIN, 0});
  double checked_s = gate_now_s();
  for (;;) {
    ::poll(watched.data(), watched.size(), kCheckMs);
    beat_s_.store(gate_now_s(), std::memory_order_relaxed);
    {
      const MutexLock lock(mutex_);
      if (stopping_) break;
    }
    bool failed = false;
    for (size_t i = 0; i < sockets_.size(); ++i)
      if (watched[i + 1].revents != 0) failed = !accept_from(sockets_[i]) || failed;
    if (failed) std::this_thread::sleep_for(kAfterFailure);
    if (gate_now_s() - checked_s < kCheckMs * 1e-3) continue;
    checked_s = gate_now_s();
    cut_overdue();
  }
}

// False when the process has no descriptor or memory left. The connection then waits in the kernel for the next try.
bool Gate::accept_from(const ListeningSocket& socket) try {
  FileDescriptor fd(::accept4(socket.fd(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (fd) {
    admit(std::move(fd), tls_ && socket.port() != 0);
    return true;
  }
  const bool exhausted = errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM;
  if (exhausted) make_room({});
  return !exhausted;
} catch (const std::bad_alloc&) {
  return false;
}

void Gate::refuse(const std::string& client, std::string_view reason) {
  {
    const MutexLock lock(mutex_);
    ++counts_.refused;
    const auto own = of_client_.find(client);
    counts_.refused_client += own != of_client_.end() && own->second >= limits_.max_per_client;
  }
  tell(client, reason);
}

// A line of the log that finds no memory is lost.
void Gate::tell(const std::string& client, std::string_view reason) noexcept try {
  notice_(client, reason);
} catch (const std::bad_alloc&) {
}

// A handshake costs the server more than its client. Full buckets are forgotten, so the map stays as small as the
// number of clients that connected lately.
bool Gate::may_shake_hands(const std::string& client) {
  const double now_s = gate_now_s();
  std::erase_if(handshakes_, [&](const auto& entry) { return entry.second.full(now_s); });
  return handshakes_.try_emplace(client, limits_.handshakes_burst, limits_.handshakes_per_s).first->second.take(now_s);
}

void Gate::note_flood(const std::string& client) try {
  const MutexLock lock(mutex_);
  floods_.try_emplace(client, Flood{TokenBucket(limits_.after_flood_burst, limits_.after_flood_per_s), 0.0})
      .first->second.last_s = gate_now_s();
} catch (const std::bad_alloc&) {  // the connection is cut in any case
}

// A client that closes all its connections and comes again finds its buckets as they were.
std::shared_ptr<ClientFlow> Gate::flow_of(const std::string& client) {
  const double now_s = gate_now_s();
  const MutexLock lock(mutex_);
  std::erase_if(flows_, [&](const auto& entry) { return entry.second.use_count() == 1 && entry.second->full(now_s); });
  std::shared_ptr<ClientFlow>& flow = flows_[client];
  if (!flow) flow = std::make_shared<ClientFlow>(limits_.frames);
  return flow;
}

// Each connection may do some work before it is cut for a flood. A client that floods again and again on new ones gets
// few of them.
bool Gate::may_connect(const std::string& client) {
  const double now_s = gate_now_s();
  const MutexLock lock(mutex_);
  std::erase_if(floods_, [&](const auto& entry) { return now_s - entry.second.last_s > limits_.after_flood_s; });
  const auto flood = floods_.find(client);
  return flood == floods_.end() || flood->second.connections.take(now_s);
}

void Gate::admit(FileDescriptor fd, bool encrypted) {
  std::string client = client_of_socket(fd.get());
  if (!may_connect(client)) return refuse(client, "too many connections after one that was cut for what it sent");
  if (encrypted && !may_shake_hands(client)) return refuse(client, "too many TLS handshakes in a short time");
  if (!make_room(client))
    return refuse(client, "no connection is left (--max-connections, --max-connections-per-client)");
  auto connection = connect_to_grpc(std::move(fd), std::move(client), encrypted);
  if (!connection) return;
  enter(connection);
  Relay& relay = encrypted ? *greeter_ : *relays_[next_relay_++ % relays_.size()];
  try {
    relay.add(connection);
  } catch (const std::bad_alloc&) {
    cut(connection, "the server is out of memory");
  }
}

// Both maps have the connection, or neither.
void Gate::enter(const std::shared_ptr<Connection>& connection) {
  const MutexLock lock(mutex_);
  const auto entered = connections_.emplace(connection->peer, connection).first;
  try {
    ++of_client_[connection->client];
  } catch (const std::bad_alloc&) {
    connections_.erase(entered);
    throw;
  }
  ++counts_.accepted;
}

// The client's end of the pair belongs to gRPC from now on.
std::shared_ptr<Connection> Gate::connect_to_grpc(FileDescriptor outer, std::string client, bool encrypted) {
  int pair[2] = {-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, pair) != 0) return nullptr;
  auto connection = std::make_shared<Connection>();
  connection->outer = std::move(outer);
  connection->inner = FileDescriptor(pair[0]);
  FileDescriptor for_grpc(pair[1]);
  for (const int fd : pair) ::setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &kPairBytes, sizeof(kPairBytes));
  if (encrypted && !(connection->tls = tls_->accept())) return nullptr;
  connection->client = std::move(client);
  connection->flow = flow_of(connection->client);
  connection->user = user_of_socket(connection->outer.get());
  connection->peer = name_socket(connection->inner.get());
  if (connection->peer.empty()) return nullptr;
  connection->since_s = gate_now_s();
  connection->deadline_s = connection->since_s + limits_.greeting_s;
  hand_over_(std::move(for_grpc));
  return connection;
}

// True when a connection of this client may be added. An empty name asks for room for anyone.
bool Gate::make_room(const std::string& client) {
  std::shared_ptr<Connection> victim;
  {
    const MutexLock lock(mutex_);
    const auto own = of_client_.find(client);
    const bool client_full = own != of_client_.end() && own->second >= limits_.max_per_client;
    if (!client.empty() && !client_full && connections_.size() < limits_.max_connections) return true;
    victim = least_needed(client_full ? client : std::string());
  }
  if (victim) cut(victim, "it was idle, and another client needed its place");
  return victim != nullptr;
}

// The connection that makes way first, of this client or, with an empty name, of all. Those on which no call was
// accepted come before the others, whatever calls were refused on them: first those of the client that has most of
// them, and of these the oldest one. The others make way when they have been idle for long. Null: there is none.
std::shared_ptr<Connection> Gate::least_needed(const std::string& client) const {
  std::map<std::string_view, size_t> unaccepted_of;
  for (const auto& [peer, connection] : connections_) unaccepted_of[connection->client] += !connection->accepted;
  const double now_s = gate_now_s();
  std::tuple<bool, size_t, double> most{false, 0, 0.0};
  std::shared_ptr<Connection> victim;
  for (const auto& [peer, connection] : connections_) {
    if (!client.empty() && connection->client != client) continue;
    const bool accepted = connection->accepted;
    const double idle_s = now_s - (accepted ? connection->last_call_s.load() : connection->since_s);
    if (accepted && idle_s < limits_.idle_s) continue;
    const std::tuple rank{!accepted, accepted ? 0 : unaccepted_of[connection->client], idle_s};
    if (rank <= most) continue;
    most = rank;
    victim = connection;
  }
  return victim;
}

// Runs on the threads of the relays. Unsigned numbers wrap, so adding a negative change is well defined.
void Gate::note_held(const Connection& connection, ptrdiff_t change) {
  const size_t all = held_bytes_ += static_cast<size_t>(change),
               client = connection.flow->held_bytes += static_cast<size_t>(change);
  const bool too_much = all > limits_.held_bytes || client > limits_.held_bytes / 2;
  if (change > 0 && too_much && limits_.held_bytes > 0) limit_held();
}

void Gate::limit_held() try {
  const std::shared_ptr<Connection> victim = largest_holder();
  if (!victim) return;
  victim->flooded = true;
  cut(victim, "messages that it began and did not complete take too much memory (--transport-memory-mib)");
} catch (const std::bad_alloc&) {  // the next byte tries again
}

// The connection that holds most, of the client that holds most. Null when neither this client nor all together hold
// too much.
std::shared_ptr<Connection> Gate::largest_holder() const {
  const MutexLock lock(mutex_);
  std::map<std::string_view, size_t> of_client;
  size_t all = 0;
  for (const auto& [peer, connection] : connections_) {
    const size_t held = connection->held_bytes;
    all += held;
    of_client[connection->client] += held;
  }
  const auto by_bytes = [](const auto& a, const auto& b) { return a.second < b.second; };
  const auto most = std::ranges::max_element(of_client, by_bytes);
  if (most == of_client.end() || (all <= limits_.held_bytes && most->second <= limits_.held_bytes / 2)) return nullptr;
  std::shared_ptr<Connection> largest;
  for (const auto& [peer, connection] : connections_)
    if (connection->client == most->first && (!largest || connection->held_bytes > largest->held_bytes))
      largest = connection;
  return largest;
}

// Without memory it is tried again in the next round.
void Gate::cut_overdue() try {
  std::vector<std::shared_ptr<Connection>> overdue;
  {
    const MutexLock lock(mutex_);
    for (const auto& [peer, connection] : connections_) {
      const double deadline_s = connection->deadline_s;
      if (deadline_s > 0.0 && gate_now_s() > deadline_s) overdue.push_back(connection);
    }
  }
  for (const auto& connection : overdue) cut(connection, "it was silent for too long");
} catch (const std::bad_alloc&) {
}

// The relay sees the end of the socket and closes it.
void Gate::cut(const std::shared_ptr<Connection>& connection, std::string_view reason) {
  over(connection, reason);
  ::shutdown(connection->outer.get(), SHUT_RDWR);
}

// Comes once from `cut` and once from the relay; the first one counts.
void Gate::over(const std::shared_ptr<Connection>& connection, std::string_view reason) {
  {
    const MutexLock lock(mutex_);
    if (connections_.erase(connection->peer) == 0) return;
    const auto own = of_client_.find(connection->client);
    if (--own->second == 0) of_client_.erase(own);
    if (!reason.empty()) ++counts_.cut;
    if (connection->handshake_failed) ++counts_.failed_handshakes;
  }
  if (!reason.empty()) tell(connection->client, reason);
}

}  // namespace sightline
