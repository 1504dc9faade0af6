// The steps of a recording in order. A thread of its own reads and decodes ahead.
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <vector>

#include "client/recordings/recording.h"

namespace sightline {

// For one consumer thread. The recording must outlive it; its head and its files may be read meanwhile.
class StepSource {
 public:
  explicit StepSource(const Recording& recording, RecordedRange range = {});
  // Stops reading.
  ~StepSource();
  StepSource(const StepSource&) = delete;
  StepSource& operator=(const StepSource&) = delete;

  // Returns the next step, oldest first; false at the end. The last one may have no reply (RecordedStep::has_reply).
  bool next(RecordedStep& step);
  // Report of the reading; complete once next() has returned false.
  const RecordedReport& report() const { return report_; }

 private:
  void read(const Recording& recording, const RecordedRange& range);
  bool hand_over(std::vector<RecordedStep>& batch);

  // Steps in a batch, and batches that may wait: about ten seconds of a session at 60 Hz.
  static constexpr size_t kBatch = 32, kWaiting = 16;

  std::vector<RecordedStep> taken_;
  size_t next_taken_ = 0;
  RecordedReport report_;  // written by the reader until ended_

  std::mutex mutex_;
  std::condition_variable changed_;
  // guarded by mutex_
  std::deque<std::vector<RecordedStep>> batches_;
  bool ended_ = false, given_up_ = false;

  std::jthread reader_;  // last, so that everything else exists when it starts
};

}  // namespace sightline
