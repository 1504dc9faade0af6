#include "client/cpp/camera.h"

#include <algorithm>
#include <atomic>
#include <fstream>
#include <iterator>
#include <optional>
#include <random>
#include <span>
#include <thread>
#include <utility>

#include "client/cpp/camera_snapshot.h"
#include "client/cpp/sightline_client.h"

namespace sightline {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr milliseconds kShortestPause{50}, kLongestPause{1'000};
// A daemon resumes a session at once, or not at all.
constexpr milliseconds kResumeTimeout{2'000};

// A waiting tick looks so often whether it is interrupted.
constexpr milliseconds kLook{50};

bool lacks_scene(const Error& error) {
  return error.code == ErrorCode::kNotFound && error.field.find("scene") != std::string::npos;
}

}  // namespace

bool is_lost(const Error& error, bool opening) {
  return error.code == ErrorCode::kUnavailable || error.code == ErrorCode::kInternal ||
         (opening && error.code == ErrorCode::kResourceExhausted && error.field != "chunk");
}

Status read_scene(CameraOptions& options) {
  const std::string path = std::exchange(options.scene_file, {});
  if (path.empty()) return {};
  std::ifstream file(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  if (text.empty()) return invalid("scene_file", "\"" + path + "\" is empty or cannot be read");
  const auto bytes = std::as_bytes(std::span(text));
  options.scene.assign(bytes.begin(), bytes.end());
  return {};
}

struct Camera::State {
  State(std::vector<std::string> reachable, v1::OpenSession opening, CameraOptions wanted)
      : addresses(std::move(reachable)), options(std::move(wanted)), snapshot(std::move(opening)) {
    if (!options.scene.empty()) uploads.push_back(options.scene);
    uploads.insert(uploads.end(), options.uploads.begin(), options.uploads.end());
  }

  // constant after construction
  const std::vector<std::string> addresses;
  const CameraOptions options;
  std::vector<std::span<const std::byte>> uploads;  // those of `options`; the client's own scene comes first

  CameraSnapshot snapshot;
  size_t address = 0;
  std::unique_ptr<ClientSession> session;  // null: it is lost, or not open so far
  std::optional<std::string> drained;      // the reason why the daemon takes no more ticks
  v1::SessionOpened opened;
  uint64_t sequence = 0;
  size_t resyncs = 0, resumes = 0;
  // of the session in the daemon at `address`, also while it is lost; empty: it cannot be resumed
  std::string token;
  uint64_t answered = 0;  // the newest tick of this session that was answered
  std::minstd_rand random{std::random_device{}()};
  std::atomic<bool> interrupted = false;

  Status open();
  Status open_session(size_t n);
  Status upload(Client& client, size_t n);
  void leave();
  void look_for_drain();
  Result<bool> resume(uint64_t wanted);
  void tell_past(v1::Tick& next);
  Result<Answer> ask(const v1::Tick& tick);
  Result<std::optional<SessionEvent>> next_event();
  Result<Answer> wait_for_answer(const v1::Tick& tick);
  Result<Answer> try_to_ask(v1::Tick& tick, bool& opening, bool& reopened);
  Result<Answer> ask_until_answered(v1::Tick& tick);
  void pause(milliseconds longest);
};

Status Camera::State::open() {
  // The opening needs the hash of the client's own scene, which comes with the first upload.
  const size_t first = !options.scene.empty() && snapshot.scene_hash().empty() ? 1 : 0;
  Status opened_now = open_session(first);
  if (!opened_now && lacks_scene(opened_now.error()) && !uploads.empty()) return open_session(uploads.size());
  return opened_now;
}

Status Camera::State::upload(Client& client, size_t n) {
  for (size_t i = 0; i < n; ++i) {
    const auto sent = client.upload_scene(uploads[i], options.open_timeout);
    if (!sent) return tl::unexpected(sent.error());
    if (i == 0 && !options.scene.empty()) snapshot.use_scene(sent->hash());
  }
  return {};
}

// After the first n of the uploads.
Status Camera::State::open_session(size_t n) {
  auto client = Client::connect(addresses[address], options.connect_timeout, {}, options.credentials);
  if (!client) return tl::unexpected(client.error());
  if (const Status sent = upload(*client, n); !sent) return sent;
  v1::OpenSession opening = snapshot.opening();
  opening.set_resumable(true);
  auto next = client->open_session(opening, options.open_timeout);
  if (!next) return tl::unexpected(next.error());
  session = std::move(*next);
  opened = session->opened();
  token = opened.resume_token();
  answered = 0;
  return {};
}

// Goes on with the lost session, if the daemon keeps it. True: the daemon has taken the tick already, and its answer
// follows. False: it has not. Without a session afterwards, and without an error, a new one must be opened.
Result<bool> Camera::State::resume(uint64_t wanted) {
  v1::ResumeSession request;
  request.set_token(token);
  request.set_answered_sequence(answered);
  auto client = Client::connect(addresses[address], options.connect_timeout, {}, options.credentials);
  auto next = client ? client->resume_session(request, std::min(options.reply_timeout, kResumeTimeout))
                     : tl::unexpected(client.error());
  if (next) {
    const uint64_t newest = (*next)->opened().newest_sequence();
    if (newest == wanted || newest == answered) {
      session = std::move(*next);
      return newest == wanted;
    }
    // It lacks ticks that a former stream lost.
    (void)(*next)->close(options.reply_timeout);
  } else if (is_lost(next.error(), true) && addresses.size() == 1) {
    return tl::unexpected(next.error());
  } else if (is_lost(next.error(), true)) {
    address = (address + 1) % addresses.size();
  }
  token.clear();
  return false;
}

// Gives the stream up. The next one goes to the next address, unless the session can be resumed.
void Camera::State::leave() {
  session.reset();
  if (drained) token.clear();
  drained.reset();
  if (token.empty()) address = (address + 1) % addresses.size();
}

void Camera::State::look_for_drain() {
  while (true) {
    const auto event = session->receive(milliseconds(0));
    if (!event || !*event) return;
    if (const auto* drain = std::get_if<v1::Drain>(&**event)) drained = drain->reason();
  }
}

// Tells a new session what happened before the tick.
void Camera::State::tell_past(v1::Tick& next) {
  uint64_t revision = opened.mirror_revision();
  for (const v1::Tick& tick : snapshot.ticks(next.sequence())) {
    if (tick.has_delta()) ++revision;
    (void)session->send(tick);  // when it fails, so does the tick that follows
  }
  if (next.delta().has_base_revision()) next.mutable_delta()->set_base_revision(revision);
}

Result<Camera::Answer> Camera::State::ask(const v1::Tick& tick) {
  if (auto sent = session->send(tick); !sent) return tl::unexpected(sent.error());
  return wait_for_answer(tick);
}

// Nothing: none came within the reply timeout.
Result<std::optional<SessionEvent>> Camera::State::next_event() {
  const auto late = steady_clock::now() + options.reply_timeout;
  while (true) {
    if (interrupted) return fail(ErrorCode::kUnavailable, "session", "interrupted");
    const auto left = std::chrono::duration_cast<std::chrono::nanoseconds>(late - steady_clock::now());
    auto event = session->receive(std::clamp<std::chrono::nanoseconds>(left, milliseconds(0), kLook));
    if (!event || *event || left <= milliseconds(0)) return event;
  }
}

Result<Camera::Answer> Camera::State::wait_for_answer(const v1::Tick& tick) {
  while (true) {
    auto event = next_event();
    if (!event && drained) return fail(ErrorCode::kUnavailable, "session", *drained);
    if (!event) return tl::unexpected(event.error());
    if (!*event) return fail(ErrorCode::kUnavailable, "deadline", "the daemon has not answered in time");
    if (auto* drain = std::get_if<v1::Drain>(&**event)) drained = drain->reason();
    if (auto* error = std::get_if<v1::TickError>(&**event)) return Answer(std::move(*error));
    auto* reply = std::get_if<v1::CameraReply>(&**event);
    if (reply && reply->sequence() == tick.sequence()) return Answer(std::move(*reply));
  }
}

Result<Camera::Answer> Camera::State::try_to_ask(v1::Tick& tick, bool& opening, bool& reopened) {
  opening = session == nullptr;
  bool taken = false;
  if (opening && !token.empty()) {
    const auto resumed = resume(tick.sequence());
    if (!resumed) return tl::unexpected(resumed.error());
    taken = *resumed;
    resumes += session ? 1 : 0;
  }
  if (!session) {
    if (Status opened_now = open(); !opened_now) return tl::unexpected(opened_now.error());
    reopened = true;
    tell_past(tick);
  }
  opening = false;
  return taken ? wait_for_answer(tick) : ask(tick);
}

Result<Camera::Answer> Camera::State::ask_until_answered(v1::Tick& tick) {
  const auto give_up = steady_clock::now() + options.give_up_after;
  std::optional<std::string> reason;
  bool reopened = false;
  if (session) look_for_drain();
  if (drained) reason = *drained, leave();
  for (milliseconds longest = kShortestPause;; longest = std::min(2 * longest, kLongestPause)) {
    bool opening = false;
    auto answer = try_to_ask(tick, opening, reopened);
    if (answer) {
      answered = tick.sequence();
      if (reopened) ++resyncs;
      if (reopened && options.on_resync) options.on_resync(reason.value_or("the former tick lost the session"));
      return answer;
    }
    if (!reason) reason = answer.error().message;
    leave();
    if (interrupted || !is_lost(answer.error(), opening) || steady_clock::now() >= give_up) return answer;
    pause(longest);
  }
}

// Pauses are random, so that the cameras of a lost daemon do not all come at once.
void Camera::State::pause(milliseconds longest) {
  std::uniform_real_distribution<double> share(0.5, 1.0);
  std::this_thread::sleep_for(longest * share(random));
}

Camera::Camera(std::unique_ptr<State> state) : state_(std::move(state)) {}
Camera::~Camera() = default;
Camera::Camera(Camera&&) noexcept = default;
Camera& Camera::operator=(Camera&&) noexcept = default;

Result<Camera> Camera::open(std::vector<std::string> addresses, v1::OpenSession opening, CameraOptions options) {
  if (addresses.empty()) return invalid("addresses", "must name a daemon");
  if (const Status read = read_scene(options); !read) return tl::unexpected(read.error());
  const size_t n = addresses.size();
  Camera camera(std::make_unique<State>(std::move(addresses), std::move(opening), std::move(options)));
  Status opened;
  for (size_t attempt = 0; attempt < n; ++attempt) {
    if ((opened = camera.state_->open())) return camera;
    camera.state_->leave();
    if (!is_lost(opened.error(), true)) break;
  }
  return tl::unexpected(opened.error());
}

Result<Camera::Answer> Camera::tick(v1::Tick tick) {
  if (tick.step_control().merge_into_next())
    return invalid("tick.step_control.merge_into_next", "a camera waits for a reply to each tick");
  if (tick.sequence() == 0) tick.set_sequence(state_->sequence + 1);
  state_->sequence = std::max(state_->sequence, tick.sequence());
  auto answer = state_->ask_until_answered(tick);
  if (!answer) return answer;
  const auto* reply = std::get_if<v1::CameraReply>(&*answer);
  if (reply || was_applied(std::get<v1::TickError>(*answer))) state_->snapshot.apply(tick);
  if (reply) state_->snapshot.take_reply(*reply);
  return answer;
}

const v1::SessionOpened& Camera::opened() const {
  return state_->opened;
}

size_t Camera::resyncs() const {
  return state_->resyncs;
}

size_t Camera::resumes() const {
  return state_->resumes;
}

void Camera::interrupt() {
  state_->interrupted = true;
}

Status Camera::close() {
  const auto session = std::move(state_->session);
  return session ? session->close(state_->options.reply_timeout) : Status{};
}

}  // namespace sightline
