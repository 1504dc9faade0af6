#include "client/drive/player.h"

#include <chrono>
#include <cmath>
#include <thread>

#include "client/scenario/scenario_session.h"

namespace sightline {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::seconds kReplyTimeout(10);

double time_of(size_t k, const PlayOptions& options) {
  return static_cast<double>(k) / options.rate_hz;
}

class Player {
 public:
  Player(const Scenario& scenario, ClientSession& session, const PlayOptions& options)
      : scenario_(scenario), session_(session), options_(options), sent_at_(tick_count(options)) {}

  Result<std::vector<PlayedFrame>> run() {
    for (size_t k = 0; k < sent_at_.size(); ++k) {
      if (!options_.lockstep)
        if (auto waited = take_replies_until(start_ + seconds(time_of(k, options_))); !waited)
          return tl::unexpected(waited.error());
      if (auto sent = send(k); !sent) return tl::unexpected(sent.error());
      if (options_.lockstep)
        if (auto answered = take_reply_to(k); !answered) return tl::unexpected(answered.error());
    }
    if (!sent_at_.empty())
      if (auto answered = take_reply_to(sent_at_.size() - 1); !answered) return tl::unexpected(answered.error());
    return std::move(frames_);
  }

 private:
  static Clock::duration seconds(double value) {
    return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(value));
  }

  Status send(size_t k) {
    const v1::Tick tick = played_tick(scenario_, options_, k);
    sent_at_[k] = Clock::now();
    return session_.send(tick);
  }

  Status take_replies_until(Clock::time_point due) {
    while (true) {
      const auto left = std::max(due - Clock::now(), Clock::duration::zero());
      auto event = session_.receive(left);
      if (!event) return tl::unexpected(event.error());
      if (!*event) return {};
      if (auto taken = take(std::move(**event)); !taken) return taken;
    }
  }

  Status take_reply_to(size_t k) {
    while (frames_.empty() || frames_.back().reply.sequence() < k + 1) {
      auto event = session_.receive(kReplyTimeout);
      if (!event) return tl::unexpected(event.error());
      if (!*event) return fail(ErrorCode::kUnavailable, "deadline", "no reply to tick " + std::to_string(k + 1));
      if (auto taken = take(std::move(**event)); !taken) return taken;
    }
    return {};
  }

  Status take(SessionEvent event) {
    if (const auto* rejection = std::get_if<v1::TickError>(&event)) return tl::unexpected(to_error(*rejection));
    if (const auto* drain = std::get_if<v1::Drain>(&event))
      return fail(ErrorCode::kUnavailable, "session", "the server is going away: " + drain->reason());
    return take_camera(std::move(std::get<v1::CameraReply>(event)));
  }

  Status take_camera(v1::CameraReply reply) {
    if (reply.sequence() < 1 || reply.sequence() > sent_at_.size())
      return fail(ErrorCode::kInternal, "reply.sequence", "answers a tick that was not sent");
    PlayedFrame played;
    const Clock::time_point now = Clock::now();
    played.latency_ms = std::chrono::duration<double, std::milli>(now - sent_at_[reply.sequence() - 1]).count();
    played.received_s = std::chrono::duration<double>(now - start_).count();
    Lens lens = scenario_.lens();
    lens.vertical_fov_rad = reply.field_of_view();
    played.frame = {reply.pose_time_s(), pose_from(reply.pose()), lens, reply.cut() || reply.flags().dt_capped()};
    played.reply = std::move(reply);
    frames_.push_back(std::move(played));
    if (options_.on_frame) options_.on_frame(frames_);
    return {};
  }

  const Scenario& scenario_;
  ClientSession& session_;
  const PlayOptions& options_;
  const Clock::time_point start_ = Clock::now();
  std::vector<Clock::time_point> sent_at_;  // by tick
  std::vector<PlayedFrame> frames_;
};

}  // namespace

size_t tick_count(const PlayOptions& options) {
  return static_cast<size_t>(std::floor(options.duration_s * options.rate_hz + 1e-9)) + 1;
}

v1::Tick played_tick(const Scenario& scenario, const PlayOptions& options, size_t k) {
  return tick_at(scenario, k + 1, time_of(k, options), 1.0 / options.rate_hz);
}

Result<std::vector<PlayedFrame>> play(const Scenario& scenario, ClientSession& session, const PlayOptions& options) {
  return Player(scenario, session, options).run();
}

}  // namespace sightline
