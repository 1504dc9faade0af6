#include "client/replay/source.h"

#include <utility>

namespace sightline {

StepSource::StepSource(const Recording& recording, RecordedRange range)
    : reader_([this, &recording, range] { read(recording, range); }) {}

StepSource::~StepSource() {
  {
    const std::lock_guard lock(mutex_);
    given_up_ = true;
  }
  changed_.notify_all();
}

bool StepSource::next(RecordedStep& step) {
  if (next_taken_ == taken_.size()) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return ended_ || !batches_.empty(); });
    if (batches_.empty()) return false;
    taken_ = std::move(batches_.front());
    batches_.pop_front();
    next_taken_ = 0;
    lock.unlock();
    changed_.notify_all();
  }
  step = std::move(taken_[next_taken_++]);
  return true;
}

void StepSource::read(const Recording& recording, const RecordedRange& range) {
  StepAssembler steps;
  std::vector<RecordedStep> batch;
  RecordedReport report = recording.read(range, [&](RecordedEvent& event) {
    if (!steps.add(event)) return true;
    batch.push_back(steps.take());
    return batch.size() < kBatch || hand_over(batch);
  });
  RecordedStep rest;
  if (steps.take_rest(rest)) batch.push_back(std::move(rest));
  if (!batch.empty()) hand_over(batch);
  const std::lock_guard lock(mutex_);
  report_ = std::move(report);
  ended_ = true;
  changed_.notify_all();
}

// Returns false when no more is wanted.
bool StepSource::hand_over(std::vector<RecordedStep>& batch) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return given_up_ || batches_.size() < kWaiting; });
  if (given_up_) return false;
  batches_.push_back(std::exchange(batch, {}));
  lock.unlock();
  changed_.notify_all();
  return true;
}

}  // namespace sightline
