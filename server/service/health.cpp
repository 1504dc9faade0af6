#include "server/service/health.h"

#include <utility>

#include "server/base/mutex.h"
#include "server/rpc/call.h"

namespace sightline {
namespace {

using grpc::health::v1::HealthCheckRequest;
using grpc::health::v1::HealthCheckResponse;
using CheckCall = AsyncCall<grpc::ServerAsyncResponseWriter<HealthCheckResponse>, HealthCheckRequest>;
using WatchCall = AsyncCall<grpc::ServerAsyncWriter<HealthCheckResponse>, HealthCheckRequest>;

HealthCheckResponse::ServingStatus to_status(bool serving) {
  return serving ? HealthCheckResponse::SERVING : HealthCheckResponse::NOT_SERVING;
}

}  // namespace

// One call of Check. It is answered at once.
class HealthService::Checker final : public CheckCall {
 public:
  Checker(EventLoop& loop, std::unique_ptr<Incoming> call, const HealthService& service)
      : CheckCall(loop, std::move(call)) {
    HealthCheckResponse response;
    response.set_status(service.status_of(incoming().request.service()));
    const bool known = response.status() != HealthCheckResponse::SERVICE_UNKNOWN;
    finish_call(response, known ? grpc::Status::OK
                                : grpc::Status(grpc::StatusCode::NOT_FOUND, "there is no service of that name"));
  }

 private:
  void on_done() override { delete this; }
};

// One call of Watch. Kept by the service until gRPC is done with it.
class HealthService::Watcher final : public WatchCall {
 public:
  Watcher(EventLoop& loop, std::unique_ptr<Incoming> incoming, HealthService& service, std::string client)
      : WatchCall(loop, std::move(incoming)), service_(service), client_(std::move(client)) {}

  const std::string& client() const { return client_; }

  // Writes the current state if it has changed. From any thread.
  void update() {
    const MutexLock lock(mutex_);
    advance();
  }
  void end() {
    const MutexLock lock(mutex_);
    ending_ = true;
    advance();
  }

 private:
  void on_write(bool ok) override {
    const MutexLock lock(mutex_);
    writing_ = false;
    ending_ = ending_ || !ok;
    advance();
  }
  void on_cancel() override { end(); }
  void on_done() override { service_.remove(this); }

  void advance() NEEDS(mutex_) {
    if (writing_ || finished_) return;
    if (ending_) {
      finished_ = true;
      return finish_call(grpc::Status::CANCELLED);
    }
    const Serving now = service_.status_of(incoming().request.service());
    if (has_written_ && message_.status() == now) return;
    message_.set_status(now);
    has_written_ = writing_ = true;
    start_write(message_);
  }

  HealthService& service_;
  const std::string client_;
  Mutex mutex_;  // taken before the service's
  HealthCheckResponse message_ GUARDED(mutex_);
  bool has_written_ GUARDED(mutex_) = false, writing_ GUARDED(mutex_) = false;
  bool ending_ GUARDED(mutex_) = false, finished_ GUARDED(mutex_) = false;
};

// A call of Watch that gets no more than a status.
class HealthService::Refused final : public WatchCall {
 public:
  Refused(EventLoop& loop, std::unique_ptr<Incoming> incoming, const grpc::Status& status)
      : WatchCall(loop, std::move(incoming)) {
    finish_call(status);
  }

 private:
  void on_done() override { delete this; }
};

void HealthService::take_calls(EventLoop& loop) {
  take_checks(loop);
  take_watches(loop);
}

void HealthService::take_checks(EventLoop& loop) {
  using Incoming = Checker::Incoming;
  const auto ask = [&](Incoming& incoming, void* tag) {
    RequestCheck(&incoming.context, &incoming.request, &incoming.responder, &loop.queue(), &loop.server_queue(), tag);
  };
  CallAcceptor<Incoming>::start(loop, ask, [this, &loop](std::unique_ptr<Incoming> incoming) {
    take_checks(loop);
    new Checker(loop, std::move(incoming), *this);
  });
}

void HealthService::take_watches(EventLoop& loop) {
  using Incoming = Watcher::Incoming;
  const auto ask = [&](Incoming& incoming, void* tag) {
    RequestWatch(&incoming.context, &incoming.request, &incoming.responder, &loop.queue(), &loop.server_queue(), tag);
  };
  CallAcceptor<Incoming>::start(loop, ask, [this, &loop](std::unique_ptr<Incoming> incoming) {
    take_watches(loop);
    std::string client = client_of_(incoming->context);
    if (const auto status = refusal(incoming->request.service(), client)) {
      new Refused(loop, std::move(incoming), *status);
      return;
    }
    admit(std::make_shared<Watcher>(loop, std::move(incoming), *this, std::move(client)));
  });
}

std::optional<grpc::Status> HealthService::refusal(const std::string& service, const std::string& client) {
  if (service.size() > kLongestName)
    return grpc::Status(grpc::StatusCode::INVALID_ARGUMENT,
                        "service: has more than " + std::to_string(kLongestName) + " bytes");
  const MutexLock lock(mutex_);
  const auto own = of_client_.find(client);
  const size_t most_of_client = most_watches_ - most_watches_ / 4;
  if (watchers_.size() < most_watches_ && (own == of_client_.end() || own->second < most_of_client))
    return std::nullopt;
  refused_();
  return grpc::Status(grpc::StatusCode::RESOURCE_EXHAUSTED, "too many Watch calls are open (--max-health-watches)");
}

void HealthService::admit(const std::shared_ptr<Watcher>& watcher) {
  bool ended = false;
  {
    const MutexLock lock(mutex_);
    watchers_.emplace(watcher.get(), watcher);
    ++of_client_[watcher->client()];
    ended = ended_;
  }
  ended ? watcher->end() : watcher->update();
}

void HealthService::set(const std::string& service, bool serving) {
  std::vector<std::shared_ptr<Watcher>> watchers;
  {
    const MutexLock lock(mutex_);
    serving_[service] = serving;
    watchers = this->watchers();
  }
  for (const auto& watcher : watchers) watcher->update();
}

void HealthService::end_watches() {
  std::vector<std::shared_ptr<Watcher>> watchers;
  {
    const MutexLock lock(mutex_);
    ended_ = true;
    watchers = this->watchers();
  }
  for (const auto& watcher : watchers) watcher->end();
}

std::vector<std::shared_ptr<HealthService::Watcher>> HealthService::watchers() const {
  std::vector<std::shared_ptr<Watcher>> all;
  for (const auto& [key, watcher] : watchers_) all.push_back(watcher);
  return all;
}

// The map may hold the last reference to the watcher, which must not be destroyed under the lock.
void HealthService::remove(const Watcher* watcher) {
  std::shared_ptr<Watcher> removed;
  const MutexLock lock(mutex_);
  const auto at = watchers_.find(watcher);
  if (at == watchers_.end()) return;
  removed = std::move(at->second);
  watchers_.erase(at);
  const auto own = of_client_.find(removed->client());
  if (--own->second == 0) of_client_.erase(own);
}

HealthService::Serving HealthService::status_of(const std::string& service) const {
  const MutexLock lock(mutex_);
  const auto found = serving_.find(service);
  return found == serving_.end() ? HealthCheckResponse::SERVICE_UNKNOWN : to_status(found->second);
}

}  // namespace sightline
