#include <algorithm>
#include <chrono>
#include <utility>

#include "client/replay/backend.h"
#include "server/base/cpu_budget.h"
#include "server/sample/embree_sampler.h"

namespace sightline {
namespace {

int64_t monotonic_ns() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

class LocalPlace final : public ReplayBackend {
 public:
  LocalPlace(std::unique_ptr<SamplerDevice> sampler, bool steps)
      : sampler_(std::move(sampler)), world_("", *sampler_), steps_(steps) {}

  Result<std::string> bring(std::span<const std::byte> file) override {
    auto asset = world_.scenes.add_uploaded(file);
    if (!asset) return tl::unexpected(std::move(asset.error()));
    held_.push_back(*asset);
    return to_hex((*asset)->hash);
  }

  Result<v1::SessionOpened> open(const v1::OpenSession& open) override {
    session_.reset();
    waiting_ = false;
    return keep_opened(LocalSession::open(open, world_, monotonic_ns), session_);
  }

  Status take(std::span<const v1::Tick> ticks, int economy_level, ReplayAnswer& answer) override {
    for (const v1::Tick& tick : ticks) {
      v1::Rejection rejection;
      if (session_->apply(tick, rejection))
        waiting_ = true;
      else
        answer.rejections.push_back(std::move(rejection));
    }
    if (!steps_ || !waiting_) return {};
    if (Status stepped = session_->step(economy_level, answer.reply); !stepped) return stepped;
    answer.has_reply = true;
    waiting_ = false;
    return {};
  }

  const Session* session() const override { return session_ ? &session_->session() : nullptr; }

 private:
  const std::unique_ptr<SamplerDevice> sampler_;
  LocalWorld world_;
  const bool steps_;
  std::vector<std::shared_ptr<const SceneAsset>> held_;  // what was brought, for ticks that name it later
  std::unique_ptr<LocalSession> session_;
  bool waiting_ = false;  // a tick was applied and no step taken since
};

}  // namespace

size_t replay_threads() {
  return static_cast<size_t>(std::min(cpu_budget(), 4));
}

std::unique_ptr<ReplayBackend> make_local_backend(std::unique_ptr<SamplerDevice> sampler) {
  return std::make_unique<LocalPlace>(std::move(sampler), true);
}

std::unique_ptr<ReplayBackend> make_mirror_backend() {
  return std::make_unique<LocalPlace>(make_embree_sampler_device(), false);
}

}  // namespace sightline
