#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "client/replay/backend.h"
#include "client/cpp/sightline_client.h"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kOpenTimeout = 5min, kUploadTimeout = 10min;  // scenes may be large
constexpr auto kReplyTimeout = 60s;
constexpr auto kRetryPause = 100ms;

class ServerPlace final : public ReplayBackend {
 public:
  ServerPlace(std::string address, std::chrono::nanoseconds patience, Client client)
      : address_(std::move(address)), patience_(patience), client_(std::move(client)) {}

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

  Status take(std::span<const v1::Tick> ticks, int economy_level, ReplayAnswer& answer) override {
    if (!session_) return fail(ErrorCode::kUnavailable, "session", "is not open");
    for (size_t i = 0; i < ticks.size(); ++i) {
      const bool last = i + 1 == ticks.size();
      if (Status sent = send(ticks[i], economy_level, last, answer); !sent) return sent;
    }
    while (!done(ticks, answer)) {
      auto event = session_->receive(kReplyTimeout);
      if (!event) return tl::unexpected(std::move(event.error()));
      if (!*event) return fail(ErrorCode::kUnavailable, "deadline", "no answer came in a minute");
      take_event(std::move(**event), answer);
    }
    return {};
  }

  // A new connection: the old one may wait long before it tries again.
  bool wait_until_back() override {
    session_.reset();
    for (const auto deadline = Clock::now() + patience_; Clock::now() < deadline;) {
      if (auto client = Client::connect(address_, 1s)) {
        client_ = std::move(*client);
        return true;
      }
      std::this_thread::sleep_for(kRetryPause);
    }
    return false;
  }

 private:
  Status send(const v1::Tick& recorded, int economy_level, bool last, ReplayAnswer& answer) {
    tick_.CopyFrom(recorded);
    tick_.mutable_step()->set_merge_into_next(!last);
    tick_.mutable_step()->set_economy_level(static_cast<uint32_t>(economy_level));
    ++unanswered_;
    while (true) {
      Status sent = session_->send(tick_);
      if (sent || sent.error().code != ErrorCode::kResourceExhausted) return sent;
      // More ticks than the connection holds: answers are taken meanwhile, so that none is dropped.
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
    } else if (auto* rejection = std::get_if<v1::Rejection>(&event)) {
      unanswered_ -= std::min<size_t>(unanswered_, 1);
      answer.rejections.push_back(std::move(*rejection));
    }  // a drain: what was sent is still answered, and the end of the stream says the rest
  }

  // When the tick that asks for a step is refused those before it wait for the next one.
  bool done(std::span<const v1::Tick> ticks, const ReplayAnswer& answer) const {
    if (unanswered_ == 0) return true;
    return !answer.rejections.empty() && answer.rejections.back().sequence() == ticks.back().sequence();
  }

  const std::string address_;
  const std::chrono::nanoseconds patience_;
  Client client_;
  std::unique_ptr<ClientSession> session_;
  size_t unanswered_ = 0;  // ticks
  v1::Tick tick_;          // reused
};

}  // namespace

Result<std::unique_ptr<ReplayBackend>> connect_backend(const std::string& address,
                                                   std::chrono::nanoseconds patience) {
  auto client = Client::connect(address, patience);
  if (!client) return tl::unexpected(std::move(client.error()));
  return std::make_unique<ServerPlace>(address, patience, std::move(*client));
}

}  // namespace sightline
