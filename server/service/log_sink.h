// Writes log lines from a thread of its own, so that no caller ever waits for whoever reads the log.
//
// A log that is not read, such as a full pipe, would otherwise stop every thread that logs, and the daemon with it.
// Lines wait in a bounded queue; what does not fit is dropped and counted, and so are lines that come faster than
// kLinesPerS. As soon as there is room again, a line says how many were dropped.
#pragma once

#include <spdlog/sinks/base_sink.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "server/base/token_bucket.h"

namespace sightline {

class PatientSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  static constexpr size_t kMostWaitingBytes = 1 << 20;
  // A burst, and the rate in the long run. Errors are exempt.
  static constexpr double kBurstLines = 4000, kLinesPerS = 500;
  // At the end what waits is still written, but not for longer than this.
  static constexpr std::chrono::milliseconds kFarewell{500};

  // The text of the line that says how many lines were dropped.
  using DropNote = std::function<std::string(uint64_t lines)>;

  // Writes to this descriptor, which must stay open.
  PatientSink(int fd, DropNote note);
  ~PatientSink() override;

 private:
  struct Queue;
  void sink_it_(const spdlog::details::log_msg& message) override;
  void flush_() override {}

  const DropNote note_;
  const std::shared_ptr<Queue> queue_;  // shared with the thread, which may outlive the sink in a write that never ends
  std::thread thread_;
  TokenBucket rate_{kBurstLines, kLinesPerS};
};

}  // namespace sightline
