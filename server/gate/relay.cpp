#include "server/gate/relay.h"

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <new>
#include <utility>

namespace sightline {
namespace {

// Reads from one side before the others have their turn.
constexpr int kReadsInARow = 4;
// Time in which a client must take what is left for it once gRPC has closed the connection.
constexpr double kFarewellS = 2.0;

}  // namespace

// One end of a connection.
struct Relay::Side {
  Line* line = nullptr;
  Side* other = nullptr;
  int fd = -1;
  bool ended = false;                   // it sends nothing more
  bool hung_up = false;                 // nor takes anything
  std::vector<std::byte> waiting = {};  // bytes for this side that it has not taken yet
  bool watched = false;                 // by epoll
  uint32_t interest = 0;                // what epoll watches for
};

struct Relay::Line {
  Line(std::shared_ptr<Connection> of, const FrameLimits& limits)
      : connection(std::move(of)), watch(limits, connection->flow) {
    client = {.line = this, .other = &grpc, .fd = connection->outer.get()};
    grpc = {.line = this, .other = &client, .fd = connection->inner.get()};
  }
  std::shared_ptr<Connection> connection;
  FrameWatch watch;
  Side client, grpc;
  bool over = false;
  bool passed_on = false;  // to the next relay, after the handshake
  bool said_goodbye = false;
  std::vector<std::byte> early = {};  // what gRPC said before the handshake was over
  // It waits until there is room for another call: the client is not read meanwhile, and what was read of it and not
  // passed on is here.
  uint64_t waits = 0;  // its place in the queue; 0: it does not wait
  std::vector<std::byte> held_back = {};
  std::string tls_trouble;
  std::string_view cut_for;  // why the client must be cut; empty: it need not
};

Relay::Relay(const FrameLimits& limits, Over over, Holds holds)
    : limits_(limits),
      over_(std::move(over)),
      holds_(std::move(holds)),
      epoll_(::epoll_create1(EPOLL_CLOEXEC)),
      wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      calls_(limits.paced_burst, limits.paced_per_s) {
  epoll_event event{.events = EPOLLIN, .data = {.ptr = nullptr}};
  ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, wake_.get(), &event);
  thread_ = std::thread([this] { run(); });
}

Relay::~Relay() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  ::eventfd_write(wake_.get(), 1);
  thread_.join();
}

void Relay::add(std::shared_ptr<Connection> connection) {
  auto line = std::make_unique<Line>(std::move(connection), limits_);
  const Line* const key = line.get();
  Lines one;
  one.emplace(key, std::move(line));
  adopt(one.extract(key));
}

void Relay::adopt(Lines::node_type line) {
  {
    const MutexLock lock(mutex_);
    new_.insert(std::move(line));
  }
  ::eventfd_write(wake_.get(), 1);
}

void Relay::run() {
  ::prctl(PR_SET_NAME, "relay");  // for ps and debuggers
  std::array<epoll_event, 64> events;
  for (;;) {
    const int count = ::epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()),
                                   waiting_.empty() ? kBeatMs : kPaceMs);
    beat_s_.store(gate_now_s(), std::memory_order_relaxed);
    bool woken = false;
    for (int i = 0; i < count; ++i) {
      const epoll_event& event = events[static_cast<size_t>(i)];
      if (auto* side = static_cast<Side*>(event.data.ptr))
        guarded(*side->line, [&] { serve(*side, event.events); });
      else
        woken = true;
    }
    let_waiting_go_on();
    ended_.clear();
    hand_on_leaving();
    if (!woken) continue;
    take_new();
    const MutexLock lock(mutex_);
    if (stopping_) break;
  }
  while (!lines_.empty()) end(*lines_.begin()->second, {});
  ended_.clear();
}

void Relay::hand_on_leaving() {
  while (!leaving_.empty()) {
    Lines::node_type line = leaving_.extract(leaving_.begin());
    line.mapped()->passed_on = false;
    next_().adopt(std::move(line));
  }
}

// Only this connection suffers when no memory is left for it.
void Relay::guarded(Line& line, const std::function<void()>& work) try { work(); } catch (const std::bad_alloc&) {
  if (!line.over && lines_.contains(&line)) end(line, "the server is out of memory");
}

void Relay::take_new() {
  eventfd_t ignored = 0;
  ::eventfd_read(wake_.get(), &ignored);
  Lines fresh;
  {
    const MutexLock lock(mutex_);
    fresh.swap(new_);
  }
  while (!fresh.empty()) {
    Line& line = *lines_.insert(fresh.extract(fresh.begin())).position->second;
    guarded(line, [&] { begin(line); });
  }
}

void Relay::begin(Line& line) {
  bool added = true;
  for (Side* side : {&line.client, &line.grpc}) {
    epoll_event event{.events = side->interest = EPOLLIN, .data = {.ptr = side}};
    added = added && ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, side->fd, &event) == 0;
    side->watched = added;
  }
  if (!added) return end(line, {});
  // Bytes that came with the end of the handshake raise no further event.
  const bool well = !line.connection->tls || take_from_client(line, {});
  !well || !line.cut_for.empty() ? end(line, line.cut_for) : settle(line);
}

void Relay::serve(Side& side, uint32_t events) {
  Line& line = *side.line;
  if (line.over || line.passed_on) return;
  bool well = (events & EPOLLERR) == 0;
  side.hung_up = side.hung_up || (events & EPOLLHUP) != 0;
  if (well && (events & EPOLLOUT) != 0) well = flush(side);
  if (well && (events & (EPOLLIN | EPOLLHUP)) != 0) well = read_from(side);
  if (!well || !line.cut_for.empty()) return end(line, line.cut_for);
  if (line.passed_on) return pass_on(line);
  settle(line);
}

// False when the connection is broken.
bool Relay::read_from(Side& side) {
  Line& line = *side.line;
  const bool held = &side == &line.client && line.waits > 0;
  for (int reads = 0; reads < kReadsInARow && !held && !side.ended && side.other->waiting.empty(); ++reads) {
    const ssize_t size = ::recv(side.fd, buffer_.data(), buffer_.size(), MSG_DONTWAIT);
    if (size < 0) return errno == EAGAIN || errno == EINTR;
    if (size == 0) {
      side.ended = true;
      return true;
    }
    const auto bytes = static_cast<size_t>(size);
    const std::span<const std::byte> come(buffer_.data(), bytes);
    if (!(&side == &line.client ? take_from_client(line, come) : take_from_grpc(line, come))) return false;
    if (!line.cut_for.empty() || line.passed_on || line.waits > 0 || bytes < buffer_.size()) return true;
  }
  return true;
}

bool Relay::take_from_client(Line& line, std::span<const std::byte> bytes) {
  plain_.clear();
  if (line.connection->tls) {
    const bool well = decrypt(line, bytes) && send_answers(line);
    if (!well || !line.cut_for.empty() || plain_.empty()) return well;
    bytes = plain_;
  }
  received_bytes_.fetch_add(bytes.size(), std::memory_order_relaxed);
  return pass_to_grpc(line, bytes);
}

// Passes on what the client said, until there is no more room for the calls that it begins.
bool Relay::pass_to_grpc(Line& line, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const size_t taken = watch_client(line, bytes);
    if (!line.cut_for.empty()) return true;
    if (!write_to(line.grpc, bytes.data(), taken)) return false;
    bytes = bytes.subspan(taken);
    const double calls = line.watch.paced_calls();
    if (calls == 0 || (waiting_.empty() && calls_.take(gate_now_s(), calls))) continue;
    line.held_back.assign(bytes.begin(), bytes.end());
    line.waits = next_place_++;
    waiting_.emplace(line.waits, &line);
    return true;
  }
  return true;
}

// The clients take turns, a call each.
void Relay::let_waiting_go_on() {
  while (Line* const line = next_waiting()) {
    if (!calls_.take(gate_now_s(), line->watch.paced_calls())) return;
    waiting_.erase(line->waits);
    line->waits = 0;
    guarded(*line, [&] {
      std::vector<std::byte> bytes;
      bytes.swap(line->held_back);
      const bool well = pass_to_grpc(*line, bytes);
      !well || !line->cut_for.empty() ? end(*line, line->cut_for) : settle(*line);
    });
  }
}

// The one that goes on next: of the clients with the fewest recent calls, which are soon forgotten, the one that has
// waited longest. Those wait on for which gRPC has not taken what came before.
Relay::Line* Relay::next_waiting() const {
  Line* next = nullptr;
  double fewest = 0.0;
  for (const auto& [place, line] : waiting_) {
    if (!line->grpc.waiting.empty()) continue;
    const double calls = line->connection->flow ? line->connection->flow->recent_calls(gate_now_s()) : 0.0;
    if (next && calls >= fewest) continue;
    next = line;
    fewest = calls;
  }
  return next;
}

bool Relay::take_from_grpc(Line& line, std::span<const std::byte> bytes) {
  line.watch.read_answers(bytes, gate_now_s());
  note_held(line, line.watch.held_bytes());
  TlsStream* const tls = line.connection->tls.get();
  if (!tls) return write_to(line.client, bytes.data(), bytes.size());
  // gRPC speaks first, but not before the client can hear it.
  if (!tls->established()) {
    line.early.insert(line.early.end(), bytes.begin(), bytes.end());
    return true;
  }
  return tls->seal(bytes) && send_answers(line);
}

// Puts what the client says into plain_.
bool Relay::decrypt(Line& line, std::span<const std::byte> bytes) {
  TlsStream& tls = *line.connection->tls;
  const bool was_established = tls.established();
  bool well = tls.receive(bytes);
  if (well && tls.established() && !was_established) {
    finish_handshake(line);
    if (line.passed_on) return true;
  }
  if (well && tls.established()) well = tls.open(plain_);
  line.client.ended = line.client.ended || tls.ended();
  if (well) return true;
  line.tls_trouble = (tls.established() ? "TLS: " : "no TLS handshake: ") + tls.trouble();
  line.cut_for = line.tls_trouble;
  line.connection->handshake_failed = !tls.established();
  send_answers(line);  // the alert that tells the client why
  return true;
}

void Relay::finish_handshake(Line& line) {
  TlsStream& tls = *line.connection->tls;
  line.connection->set_certificate(tls.certificate_name());
  tls.seal(line.early);
  line.early = {};
  line.passed_on = next_ != nullptr;
}

// Sends the client what TLS has for it.
bool Relay::send_answers(Line& line) {
  sealed_.clear();
  line.connection->tls->take_outgoing(sealed_);
  if (sealed_.empty()) return true;
  if (line.client.waiting.size() > kMostAnswers) return false;
  return write_to(line.client, sealed_.data(), sealed_.size());
}

// Its events of this round may still be in the queue, but they say nothing that the next relay would not see.
void Relay::pass_on(Line& line) {
  for (const Side* side : {&line.client, &line.grpc}) ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, side->fd, nullptr);
  leaving_.insert(lines_.extract(&line));
}

// Returns the number of bytes that may be passed on.
size_t Relay::watch_client(Line& line, std::span<const std::byte> bytes) {
  const bool greeted = line.watch.greeted();
  Connection& connection = *line.connection;
  const size_t taken = line.watch.read_until_call(bytes, gate_now_s());
  if (line.watch.reason()) {
    line.cut_for = *line.watch.reason();
    connection.flooded = line.watch.flooded();
  }
  connection.calls.store(line.watch.calls(), std::memory_order_relaxed);
  connection.last_call_s.store(line.watch.last_call_s(), std::memory_order_relaxed);
  if (!greeted && line.watch.greeted()) connection.deadline_s = 0.0;
  note_held(line, line.watch.held_bytes());
  return taken;
}

void Relay::note_held(Line& line, size_t bytes) {
  const size_t before = line.connection->held_bytes.exchange(bytes);
  if (bytes != before) holds_(*line.connection, static_cast<ptrdiff_t>(bytes) - static_cast<ptrdiff_t>(before));
}

bool Relay::write_to(Side& side, const std::byte* bytes, size_t size) {
  if (!side.waiting.empty()) {
    side.waiting.insert(side.waiting.end(), bytes, bytes + size);
    return true;
  }
  const ssize_t sent = ::send(side.fd, bytes, size, MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent < 0 && errno != EAGAIN && errno != EINTR) return false;
  const auto taken = static_cast<size_t>(std::max<ssize_t>(sent, 0));
  if (&side == &side.line->client) sent_bytes_.fetch_add(taken, std::memory_order_relaxed);
  if (taken < size) side.waiting.insert(side.waiting.end(), bytes + taken, bytes + size);
  return true;
}

bool Relay::flush(Side& side) {
  std::vector<std::byte> bytes;
  bytes.swap(side.waiting);
  return write_to(side, bytes.data(), bytes.size());
}

// Decides what comes next for both sides after one of them was served.
void Relay::settle(Line& line) {
  // gRPC has closed: the client gets what is left, and that was all.
  if (line.grpc.ended) {
    if (TlsStream* const tls = line.connection->tls.get(); tls && !line.said_goodbye) {
      line.said_goodbye = true;
      tls->close();
      if (!send_answers(line)) return end(line, {});
    }
    if (line.client.waiting.empty()) return end(line, {});
  }
  if ((line.grpc.ended || line.grpc.hung_up) && line.connection->deadline_s == 0.0)
    line.connection->deadline_s = gate_now_s() + kFarewellS;
  // The client has closed: gRPC learns of it when it has read everything, and closes in turn.
  if (line.client.ended && line.waits == 0 && line.grpc.waiting.empty()) ::shutdown(line.grpc.fd, SHUT_WR);
  if (!adjust(line.client) || !adjust(line.grpc)) end(line, {});
}

// False when the kernel has no memory for it.
bool Relay::adjust(Side& side) {
  uint32_t interest = 0;
  const bool held = &side == &side.line->client && side.line->waits > 0;
  if (!side.ended && !held && side.other->waiting.empty()) interest |= EPOLLIN;
  if (!side.waiting.empty()) interest |= EPOLLOUT;
  // epoll reports a hang-up again and again, whether it is asked for or not. So such a socket leaves epoll while there
  // is nothing to do for it.
  const bool watched = interest != 0 || !side.hung_up;
  if (watched == side.watched && interest == side.interest) return true;
  const int change = !watched ? EPOLL_CTL_DEL : side.watched ? EPOLL_CTL_MOD : EPOLL_CTL_ADD;
  side.watched = watched;
  epoll_event event{.events = side.interest = interest, .data = {.ptr = &side}};
  return ::epoll_ctl(epoll_.get(), change, side.fd, &event) == 0;
}

void Relay::end(Line& line, std::string_view reason) {
  line.over = true;
  waiting_.erase(line.waits);
  note_held(line, 0);
  over_(line.connection, reason);
  for (const Side* side : {&line.client, &line.grpc}) ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, side->fd, nullptr);
  // The sockets close with the last reference, which may be in `ended_` for the rest of this round.
  ended_.insert(lines_.extract(&line));
}

}  // namespace sightline
