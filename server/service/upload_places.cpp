#include "server/service/upload_places.h"

#include <algorithm>
#include <utility>

namespace sightline {

UploadPlaces::Place::~Place() {
  const std::lock_guard lock(places_.mutex_);
  places_.bytes_ -= at_->bytes;
  places_.uploads_.erase(at_);
}

bool UploadPlaces::Place::add(size_t bytes) {
  const std::lock_guard lock(places_.mutex_);
  if (places_.bytes_ + bytes > places_.max_bytes_) return false;
  at_->bytes += bytes;
  places_.bytes_ += bytes;
  return true;
}

bool UploadPlaces::Place::complete() {
  const std::lock_guard lock(places_.mutex_);
  at_->complete = true;
  return !at_->displaced;
}

void UploadPlaces::take(std::optional<Place>& place, std::function<void()> cancel) {
  const std::lock_guard lock(mutex_);
  const auto holds = [](const Upload& upload) { return !upload.displaced; };
  if (static_cast<size_t>(std::count_if(uploads_.begin(), uploads_.end(), holds)) >= max_uploads_) make_room();
  if (static_cast<size_t>(std::count_if(uploads_.begin(), uploads_.end(), holds)) >= max_uploads_) return;
  uploads_.push_back({.cancel = std::move(cancel), .since = std::chrono::steady_clock::now()});
  place.emplace(*this, std::prev(uploads_.end()));
}

void UploadPlaces::make_room() {
  const auto now = std::chrono::steady_clock::now();
  Upload* slowest = nullptr;
  double slowest_rate = kLeastBytesPerS;
  for (Upload& upload : uploads_) {
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
