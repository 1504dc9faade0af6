#include "client/replay/backend.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "client/cpp/sightline_client.h"
#include "server/base/cpu_budget.h"
#include "server/sample/embree_sampler.h"

namespace sightline {
namespace {

int64_t monotonic_ns() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

class LocalBackend final : public ReplayBackend {
 public:
  LocalBackend(std::unique_ptr<SamplerDevice> sampler, bool steps)
      : sampler_(std::move(sampler)), world_("", *sampler_), steps_(steps) {}

  Result<std::string> bring(std::span<const std::byte> file) override { return world_.bring(file); }

  Result<v1::SessionOpened> open(const v1::OpenSession& open) override {
    session_.reset();
    waiting_ = false;
    return keep_opened(LocalSession::open(open, world_, monotonic_ns), session_);
  }

  Status take(std::span<const v1::Tick> ticks, int quality_level, ReplayAnswer& answer) override {
    for (const v1::Tick& tick : ticks) {
      v1::TickError rejection;
      if (session_->apply(tick, rejection))
        waiting_ = true;
      else
        answer.rejections.push_back(std::move(rejection));
    }
    if (!steps_ || !waiting_) return {};
    if (Status stepped = session_->step(quality_level, answer.reply); !stepped) return stepped;
    answer.has_reply = true;
    waiting_ = false;
    return {};
  }

  Status resume(std::span<const v1::Tick> ticks, const v1::StepMemory& memory) override {
    for (const v1::Tick& tick : ticks) {
      v1::TickError rejection;
      if (!session_->apply(tick, rejection))
        return invalid("memory", "its snapshot tick is refused: " + rejection.message());
    }
    waiting_ = false;
    return session_->resume(memory);
  }

  const Session* session() const override { return session_ ? &session_->session() : nullptr; }

 private:
  const std::unique_ptr<SamplerDevice> sampler_;
  LocalWorld world_;
  const bool steps_;
  std::unique_ptr<LocalSession> session_;
  bool waiting_ = false;  // a tick was applied and no step taken since
};

// ---- at a daemon ----

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kOpenTimeout = 5min, kUploadTimeout = 10min;  // scenes may be large
constexpr auto kReplyTimeout = 60s;
constexpr auto kRetryPause = 100ms;

class ServerBackend final : public ReplayBackend {
 public:
  ServerBackend(std::string address, std::chrono::nanoseconds timeout, ClientCredentials credentials, Client client)
      : address_(std::move(address)),
        timeout_(timeout),
        credentials_(std::move(credentials)),
        client_(std::move(client)) {}

  Result<std::string> bring(std::span<const std::byte> file) override {
    auto reply = client_.upload_scene(file, kUploadTimeout);
    if (!reply) return tl::unexpected(std::move(reply.error()));
    return reply->hash();
  }

  Result<v1::SessionOpened> open(const v1::OpenSession& open) override {
    session_.reset();
    unanswered_ = 0;
    return keep_opened(client_.open_session(open, kOpenTimeout), session_);
  }

  Status take(std::span<const v1::Tick> ticks, int quality_level, ReplayAnswer& answer) override {
    if (!session_) return fail(ErrorCode::kUnavailable, "session", "is not open");
    for (size_t i = 0; i < ticks.size(); ++i) {
      const bool last = i + 1 == ticks.size();
      if (Status sent = send(ticks[i], quality_level, last, answer); !sent) return sent;
    }
    while (!done(ticks, answer)) {
      auto event = session_->receive(kReplyTimeout);
      if (!event) return tl::unexpected(std::move(event.error()));
      if (!*event) return fail(ErrorCode::kUnavailable, "deadline", "no answer came in a minute");
      take_event(std::move(**event), answer);
    }
    return {};
  }

  Status resume(std::span<const v1::Tick>, const v1::StepMemory&) override {
    return fail(ErrorCode::kUnsupported, "memory", "a daemon cannot take over the memory of a recorded session");
  }

  // Makes a new connection, since the old one may wait long before it tries again.
  bool wait_until_back() override {
    session_.reset();
    for (const auto deadline = Clock::now() + timeout_; Clock::now() < deadline;) {
      if (auto client = Client::connect(address_, 1s, {}, credentials_)) {
        client_ = std::move(*client);
        return true;
      }
      std::this_thread::sleep_for(kRetryPause);
    }
    return false;
  }

 private:
  Status send(const v1::Tick& recorded, int quality_level, bool last, ReplayAnswer& answer) {
    tick_.CopyFrom(recorded);
    tick_.mutable_step_control()->set_merge_into_next(!last);
    tick_.mutable_step_control()->set_quality_level(static_cast<uint32_t>(quality_level));
    ++unanswered_;
    while (true) {
      Status sent = session_->send(tick_);
      if (sent || sent.error().code != ErrorCode::kResourceExhausted) return sent;
      // There are more ticks than the connection holds. Answers are received meanwhile, so that none is dropped.
      auto event = session_->receive(1ms);
      if (!event) return tl::unexpected(std::move(event.error()));
      if (*event) take_event(std::move(**event), answer);
    }
  }

  void take_event(SessionEvent event, ReplayAnswer& answer) {
    if (auto* reply = std::get_if<v1::CameraReply>(&event)) {
      unanswered_ -= std::min<size_t>(unanswered_, size_t{1} + reply->merged_ticks());
      answer.reply = std::move(*reply);
      answer.has_reply = true;
    } else if (auto* rejection = std::get_if<v1::TickError>(&event)) {
      unanswered_ -= std::min<size_t>(unanswered_, 1);
      answer.rejections.push_back(std::move(*rejection));
    }  // a drain: the ticks so far are still answered, and then the stream ends
  }

  // When the tick that asks for a step is refused, the ticks before it wait for the next step.
  bool done(std::span<const v1::Tick> ticks, const ReplayAnswer& answer) const {
    if (unanswered_ == 0) return true;
    return !answer.rejections.empty() && answer.rejections.back().sequence() == ticks.back().sequence();
  }

  const std::string address_;
  const std::chrono::nanoseconds timeout_;
  const ClientCredentials credentials_;
  Client client_;
  std::unique_ptr<ClientSession> session_;
  size_t unanswered_ = 0;  // ticks
  v1::Tick tick_;          // reused
};

}  // namespace

size_t replay_threads() {
  return static_cast<size_t>(std::min(cpu_budget(), 4));
}

std::unique_ptr<ReplayBackend> make_local_backend(std::unique_ptr<SamplerDevice> sampler) {
  return std::make_unique<LocalBackend>(std::move(sampler), true);
}

std::unique_ptr<ReplayBackend> make_mirror_backend() {
  return std::make_unique<LocalBackend>(make_embree_sampler_device(), false);
}

Result<std::unique_ptr<ReplayBackend>> connect_backend(const std::string& address, std::chrono::nanoseconds timeout,
                                                       const ClientCredentials& credentials) {
  auto client = Client::connect(address, timeout, {}, credentials);
  if (!client) return tl::unexpected(std::move(client.error()));
  return std::make_unique<ServerBackend>(address, timeout, credentials, std::move(*client));
}

}  // namespace sightline
