// The steps of a recording one after the other, unpacked and decoded ahead by a thread of its own.
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <vector>

#include "client/recordings/recording.h"

namespace sightline {

// One thread takes. The recording must outlive it; its head and its files may be read meanwhile.
class StepSource {
 public:
  explicit StepSource(const Recording& recording, RecordedRange range = {});
  // Gives up what has not been read.
  ~StepSource();
  StepSource(const StepSource&) = delete;
  StepSource& operator=(const StepSource&) = delete;

  // The next step, oldest first; the last one may be without a reply (RecordedStep::has_reply). False: there is no more.
  bool next(RecordedStep& step);
  // What the reading met; whole once next() has answered false.
  const RecordedReport& report() const { return report_; }

 private:
  void read(const Recording& recording, const RecordedRange& range);
  bool hand_over(std::vector<RecordedStep>& batch);

  // Steps a batch, and batches that wait: some ten seconds of a session ahead.
  static constexpr size_t kBatch = 32, kWaiting = 16;

  std::vector<RecordedStep> taken_;
  size_t next_taken_ = 0;
  RecordedReport report_;  // the reader's until ended_

  std::mutex mutex_;
  std::condition_variable changed_;
  // guarded by mutex_
  std::deque<std::vector<RecordedStep>> batches_;
  bool ended_ = false, given_up_ = false;

  std::jthread reader_;  // last: everything else is there when it starts
};

}  // namespace sightline
