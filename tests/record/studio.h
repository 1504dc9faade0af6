// A recorder over a pretended disk, and the contents of its files afterwards.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/record/mcap_reader.h"
#include "server/record/mcap_verify.h"
#include "server/record/recorder.h"
#include "tests/record/pretended_files.h"

namespace sightline::test {

inline constexpr uint64_t kSecondNs = 1'000'000'000;

// A writer over a pretended disk, with a clock that the test moves by hand. Nothing runs unless the test calls it.
struct Studio {
  explicit Studio(RecordSettings with = {}) : settings(std::move(with)) {
    files.now_ns = 1000 * kSecondNs;
    settings.folder = "recordings";
    make_writer();
  }
  void make_writer() {
    writer = std::make_unique<RecordWriter>(
        settings, files, [this] { return files.now_ns; },
        [this](const RecordWarning& warning) { warnings.push_back(warning); });
  }
  std::unique_ptr<SessionRecorder> open(const std::string& id = "abc") {
    v1::RecordingInfo info;
    info.set_session_id(id);
    info.set_seed(7);
    info.set_sampler("embree");
    return writer->open_session(info);
  }
  // One tick of 1/60 s; true when it was taken.
  bool tick(SessionRecorder& recorder) {
    v1::Tick tick;
    tick.set_sequence(++ticks);
    tick.set_time_s(static_cast<double>(ticks) / 60);
    files.now_ns += kSecondNs / 60;
    return recorder.record(RecordTopic::kTick, {files.now_ns, files.now_ns}, tick);
  }
  // Sends the reply to the newest tick.
  void answer(SessionRecorder& recorder) {
    v1::CameraReply reply;
    reply.set_sequence(ticks);
    recorder.record(RecordTopic::kReply, {files.now_ns, files.now_ns}, reply);
  }
  void later(uint64_t seconds) {
    files.now_ns += seconds * kSecondNs;
    writer->run_once();
  }

  RecordSettings settings;
  PretendedFiles files;
  std::vector<RecordWarning> warnings;
  std::unique_ptr<RecordWriter> writer;
  uint64_t ticks = 0;
};

struct Contents {
  std::vector<uint64_t> ticks;  // their own sequence, without the snapshot tick
  uint64_t snapshot_ticks = 0;
  uint64_t replies = 0;
  uint64_t gap_messages = 0;
  std::set<v1::Gap::Reason> gap_reasons;
  std::vector<std::string> topics;  // of every message
  uint64_t missing = 0;             // by the sequence numbers of the tick's topic
};

inline Contents contents_of(const std::string& bytes, bool sound = true) {
  const MemorySource source(bytes);
  const McapReader reader = McapReader::open(source, {}).value();
  EXPECT_TRUE(!sound || verify_mcap(source, {}).value().sound());
  Contents found;
  bool first_tick = true;
  reader.read({}, [&](const McapMessage& m) {
    found.topics.push_back(m.channel.topic);
    if (m.channel.topic == "/sightline/info") {
      v1::RecordingInfo info;
      EXPECT_TRUE(info.ParseFromString(std::string(m.message.data)));
      found.snapshot_ticks = info.snapshot_ticks();
    }
    found.replies += m.channel.topic == "/sightline/reply";
    if (m.channel.topic == "/sightline/tick") {
      v1::Tick tick;
      EXPECT_TRUE(tick.ParseFromString(std::string(m.message.data)));
      if (found.snapshot_ticks == 0 || !std::exchange(first_tick, false)) found.ticks.push_back(tick.sequence());
    }
    if (m.channel.topic == "/sightline/gap") {
      v1::Gap gap;
      EXPECT_TRUE(gap.ParseFromString(std::string(m.message.data)));
      found.gap_messages += gap.messages();
      found.gap_reasons.insert(gap.reason());
    }
    return true;
  });
  const auto topics = verify_mcap(source, {}).value().topics;
  if (const auto tick = topics.find("/sightline/tick"); tick != topics.end()) found.missing = tick->second.missing;
  return found;
}

inline std::vector<uint64_t> numbers(uint64_t first, uint64_t last) {
  std::vector<uint64_t> out;
  for (uint64_t i = first; i <= last; ++i) out.push_back(i);
  return out;
}

}  // namespace sightline::test
