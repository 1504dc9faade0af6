#include "server/service/kept_sessions.h"

#include <sys/random.h>

#include <algorithm>
#include <cstring>
#include <system_error>
#include <utility>

namespace sightline {
namespace {

using std::chrono::steady_clock;

// A token is the number of the session, which finds it, and a secret.
constexpr size_t kNumberBytes = sizeof(uint64_t);

// In a time that does not depend on where they differ.
template <size_t size>
bool equal_secrets(const std::array<unsigned char, size>& a, const char* b) {
  volatile unsigned char difference = 0;
  for (size_t i = 0; i < size; ++i)
    difference = difference | static_cast<unsigned char>(a[i] ^ static_cast<unsigned char>(b[i]));
  return difference == 0;
}

void fill_at_random(void* bytes, size_t size) {
  if (::getrandom(bytes, size, 0) != static_cast<ssize_t>(size))
    throw std::system_error(errno, std::generic_category(), "getrandom");
}

uint64_t number_of(const std::string& token) {
  uint64_t number = 0;
  std::memcpy(&number, token.data(), kNumberBytes);
  return number;
}

}  // namespace

// Stands in the registry for the stream that a kept session no longer has.
class KeptSessions::Place final : public Drainable {
 public:
  Place(KeptSessions& kept, uint64_t number) : kept_(kept), number_(number) {}

  void drain(const std::string& reason) override { kept_.end(number_, {grpc::StatusCode::UNAVAILABLE, reason}); }
  void end(const grpc::Status& status) override { kept_.end(number_, status); }

 private:
  KeptSessions& kept_;
  const uint64_t number_;
};

KeptSessions::KeptSessions(std::chrono::milliseconds grace, StreamRegistry& streams, StepStats& stats, const Log& log)
    : grace_(grace), streams_(streams), stats_(stats), log_(log) {
  if (enabled()) thread_ = std::thread([this] { end_those_that_expire(); });
}

KeptSessions::~KeptSessions() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
  while (!entries_.empty()) {
    const uint64_t number = entries_.begin()->first;
    end(number, {grpc::StatusCode::UNAVAILABLE, "the server has stopped"});
    entries_.erase(number);
  }
}

std::string KeptSessions::issue(const std::string& client, const std::shared_ptr<ResumableStream>& stream) {
  Entry entry;
  fill_at_random(entry.secret.data(), entry.secret.size());
  entry.client = client;
  entry.stream = stream;
  const MutexLock lock(mutex_);
  const uint64_t number = ++last_number_;
  std::string token(kNumberBytes + entry.secret.size(), '\0');
  std::memcpy(token.data(), &number, kNumberBytes);
  std::memcpy(token.data() + kNumberBytes, entry.secret.data(), entry.secret.size());
  entries_.emplace(number, std::move(entry));
  return token;
}

KeptSessions::Entries::iterator KeptSessions::find(const std::string& token, const std::string* client) {
  if (token.size() != kNumberBytes + sizeof(Secret)) return entries_.end();
  const auto entry = entries_.find(number_of(token));
  if (entry == entries_.end() || !equal_secrets(entry->second.secret, token.data() + kNumberBytes))
    return entries_.end();
  return !client || entry->second.client == *client ? entry : entries_.end();
}

bool KeptSessions::keep(const Drainable* stream, std::unique_ptr<DetachedSession>& session) {
  uint64_t number = 0;
  {
    const MutexLock lock(mutex_);
    const auto entry = find(session->token, nullptr);
    if (entry == entries_.end()) return false;
    number = entry->first;
  }
  return pass_on(number, session, stream) || put_away(number, session, stream, nullptr, steady_clock::now() + grace_);
}

// Gives the session to the stream that waits for it. False: none does.
bool KeptSessions::pass_on(uint64_t number, std::unique_ptr<DetachedSession>& session, const Drainable* holder) {
  for (;;) {
    std::shared_ptr<ResumableStream> claimant;
    {
      const MutexLock lock(mutex_);
      Entry& entry = entries_.at(number);
      claimant = std::exchange(entry.claimant, {}).lock();
      if (!claimant) return false;
      // Before it has the session, since it may give it up again at once.
      entry.stream = claimant;
    }
    const std::string id = session->driver->session_id();
    if (claimant->take_session(session, holder)) {
      ++stats_.resumed;
      log_.info("session resumed", {{"session", id}});
      return true;
    }
    deny(*claimant);
  }
}

// Keeps the session in the place of `holder`, which may be its own already. False: the server drains.
bool KeptSessions::put_away(uint64_t number, std::unique_ptr<DetachedSession>& session, const Drainable* holder,
                            std::shared_ptr<Place> place, Time expires) {
  MutexLock lock(mutex_);
  // A stream may have come for it since `pass_on` returned.
  while (!entries_.at(number).claimant.expired()) {
    lock.unlock();
    if (pass_on(number, session, holder)) return true;
    lock.lock();
  }
  Entry& entry = entries_.at(number);
  if (!place) {
    place = std::make_shared<Place>(*this, number);
    if (!streams_.move_place(holder, place)) return false;
    log_.info("session kept",
              {{"session", session->driver->session_id()}, {"grace_ms", std::to_string(grace_.count())}});
  }
  entry.place = std::move(place);
  entry.session = std::move(session);
  entry.expires = expires;
  ++stats_.kept;
  wake_.notify_all();
  return true;
}

void KeptSessions::deny(ResumableStream& claimant) {
  ++stats_.resume_refused;
  std::unique_ptr<DetachedSession> none;
  (void)claimant.take_session(none, nullptr);
}

void KeptSessions::forget(const std::string& token) {
  std::shared_ptr<ResumableStream> claimant;
  {
    const MutexLock lock(mutex_);
    const auto entry = find(token, nullptr);
    if (entry == entries_.end()) return;
    claimant = entry->second.claimant.lock();
    entries_.erase(entry);
  }
  if (claimant) deny(*claimant);
}

void KeptSessions::claim(const std::string& token, const std::string& client,
                         const std::shared_ptr<ResumableStream>& claimant) {
  std::unique_ptr<DetachedSession> session;
  std::shared_ptr<ResumableStream> stream, former_claimant;
  std::shared_ptr<Place> place;
  Time expires{};
  uint64_t number = 0;
  {
    const MutexLock lock(mutex_);
    const auto found = find(token, &client);
    if (found != entries_.end()) {
      Entry& entry = found->second;
      number = found->first;
      former_claimant = std::exchange(entry.claimant, claimant).lock();
      if ((session = std::move(entry.session))) --stats_.kept;
      place = std::move(entry.place);
      expires = entry.expires;
      stream = entry.stream.lock();
    }
  }
  if (former_claimant) deny(*former_claimant);
  if (number == 0) return deny(*claimant);
  if (!session && stream) return stream->give_session_up();
  if (session && !pass_on(number, session, place.get())) (void)put_away(number, session, place.get(), place, expires);
}

void KeptSessions::end(uint64_t number, const grpc::Status& status) {
  std::unique_ptr<DetachedSession> session;
  std::shared_ptr<Place> place;
  {
    const MutexLock lock(mutex_);
    const auto entry = entries_.find(number);
    if (entry == entries_.end() || !entry->second.session) return;
    session = std::move(entry->second.session);
    place = std::move(entry->second.place);
    --stats_.kept;
    entries_.erase(entry);
  }
  session->driver->close(status);
  streams_.remove(place.get());
}

std::optional<KeptSessions::Time> KeptSessions::first_to_expire() const {
  std::optional<Time> first;
  for (const auto& [number, entry] : entries_)
    if (entry.session && (!first || entry.expires < *first)) first = entry.expires;
  return first;
}

void KeptSessions::end_those_that_expire() {
  MutexLock lock(mutex_);
  while (!stopping_) {
    const std::optional<Time> first = first_to_expire();
    first ? (void)wake_.wait_until(lock, *first) : wake_.wait(lock);
    std::deque<uint64_t> expired;
    for (const auto& [number, entry] : entries_)
      if (entry.session && entry.expires <= steady_clock::now()) expired.push_back(number);
    lock.unlock();
    for (const uint64_t number : expired) {
      ++stats_.resume_expired;
      end(number,
          {grpc::StatusCode::CANCELLED, "its stream broke, and no stream resumed it in time (--resume-grace-s)"});
    }
    lock.lock();
  }
}

}  // namespace sightline
