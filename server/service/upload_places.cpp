#include "server/service/upload_places.h"

#include <algorithm>
#include <utility>

namespace sightline {

UploadPlaces::Place::~Place() {
  const MutexLock lock(places_.mutex_);
  places_.bytes_ -= at_->bytes;
  places_.uploads_.erase(at_);
}

bool UploadPlaces::Place::add(size_t bytes) {
  const MutexLock lock(places_.mutex_);
  if (places_.bytes_ + bytes > places_.max_bytes_) return false;
  at_->bytes += bytes;
  places_.bytes_ += bytes;
  return true;
}

bool UploadPlaces::Place::complete() {
  const MutexLock lock(places_.mutex_);
  at_->complete = true;
  return !at_->displaced;
}

bool UploadPlaces::Place::late() const {
  const MutexLock lock(places_.mutex_);
  return is_late(at_->bytes, std::chrono::steady_clock::now() - at_->since);
}

size_t UploadPlaces::held_by(const std::string* client) const {
  const auto holds = [&](const Upload& upload) { return !upload.displaced && (!client || upload.client == *client); };
  return static_cast<size_t>(std::count_if(uploads_.begin(), uploads_.end(), holds));
}

void UploadPlaces::take(std::optional<Place>& place, const std::string& client, std::function<void()> cancel) {
  const MutexLock lock(mutex_);
  if (ended_) return;
  if (held_by(&client) >= max_of_client()) make_room(&client);
  if (held_by(&client) >= max_of_client()) return;
  if (held_by(nullptr) >= max_uploads_) make_room(nullptr);
  if (held_by(nullptr) >= max_uploads_) return;
  uploads_.push_back({.client = client, .cancel = std::move(cancel), .since = std::chrono::steady_clock::now()});
  place.emplace(*this, std::prev(uploads_.end()));
}

void UploadPlaces::end_all() {
  const MutexLock lock(mutex_);
  ended_ = true;
  for (Upload& upload : uploads_)
    if (!std::exchange(upload.displaced, true)) upload.cancel();
}

bool UploadPlaces::ended() const {
  const MutexLock lock(mutex_);
  return ended_;
}

void UploadPlaces::make_room(const std::string* client) {
  const auto now = std::chrono::steady_clock::now();
  Upload* slowest = nullptr;
  double slowest_rate = kLeastBytesPerS;
  for (Upload& upload : uploads_) {
    if (client && upload.client != *client) continue;
    if (upload.complete || upload.displaced || now - upload.since < kFirstJudged) continue;
    const double rate = static_cast<double>(upload.bytes) / std::chrono::duration<double>(now - upload.since).count();
    if (rate >= slowest_rate) continue;
    slowest_rate = rate;
    slowest = &upload;
  }
  if (!slowest) return;
  slowest->displaced = true;
  slowest->cancel();
}

}  // namespace sightline
