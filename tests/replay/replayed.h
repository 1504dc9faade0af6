// Recordings in memory, replayed in this process.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "client/recordings/reply_fields.h"
#include "client/recordings/writer.h"
#include "client/replay/replay.h"
#include "client/replay/result.h"
#include "server/sample/embree_sampler.h"
#include "tests/recordings/string_sink.h"

namespace sightline::test {

// `bytes` must outlive it.
inline Recording open_recording(const std::string& bytes) {
  auto recording = Recording::open(std::make_shared<MemorySource>(bytes), "memory");
  EXPECT_TRUE(recording.has_value());
  return std::move(*recording);
}

// The same recording with other events. `change` returns false to leave an event out, and may write others before it.
inline std::string rewritten(const std::string& bytes,
                             const std::function<bool(RecordedEvent&, RecordingWriter&)>& change,
                             const std::function<void(v1::RecordingInfo&)>& change_info = {}) {
  const Recording recording = open_recording(bytes);
  std::string out;
  v1::RecordingInfo info = recording.info();
  if (change_info) change_info(info);
  RecordingWriter writer(std::make_unique<StringSink>(out), info);
  EXPECT_TRUE(writer.write(recording.open_session(), recording.start_ns()).has_value());
  EXPECT_TRUE(writer.write(recording.opened(), recording.start_ns()).has_value());
  const auto files = recording.files();
  for (const RecordedFile& file : *files) EXPECT_TRUE(writer.attach(file, recording.start_ns()).has_value());
  recording.read({}, [&](RecordedEvent& event) {
    if (!change(event, writer)) return true;
    std::visit([&](const auto& message) { EXPECT_TRUE(writer.write(message, event.log_ns).has_value()); },
               event.message);
    return true;
  });
  EXPECT_TRUE(writer.finish().has_value());
  return out;
}

struct Replayed {
  uint64_t replies = 0, equal = 0, hash = 0;
  ReplayVerdict verdict = ReplayVerdict::kEqual;
  uint64_t observed_left_out = 0, observed_kept = 0;
  double position_m = 0.0;
  bool restarts_equal = false;  // see Replay
  std::vector<v1::CameraReply> all;
  std::string text;  // as the command prints it
};

inline Replayed replay_on(ReplayBackend& place, const Recording& recording, const std::vector<std::string>& set = {},
                          const std::string& never_equal = {}, SceneFileOptions scene_options = {},
                          const std::function<void(uint64_t)>& before_step = {}) {
  std::vector<ReplaySetting> settings;
  for (const std::string& text : set) settings.push_back(read_replay_setting(text).value());
  SceneFiles scenes(recording, std::move(scene_options));
  Replay replay(recording, place, scenes, settings);
  Replayed done;
  const Status opened = replay.open();
  EXPECT_TRUE(opened.has_value()) << to_string(opened.error());
  if (!opened) return done;
  ReplayResult tally(replay.convention(), never_equal, reply_fields_unknown_to(recording.container()));
  ReplayedStep step;
  for (uint64_t i = 0;; ++i) {
    if (before_step) before_step(i);
    const auto more = replay.next(step);
    EXPECT_TRUE(more.has_value()) << to_string(more.error());
    if (!more || !*more) break;
    tally.excuse(replay.inexact());
    tally.add(step);
    if (step.answer.has_reply) done.all.push_back(step.answer.reply);
  }
  std::ostringstream text;
  tally.print(text);
  const ReplyComparison& replies = tally.replies();
  done.replies = replies.compared();
  done.equal = replies.equal();
  done.hash = replies.hash_b();
  done.restarts_equal = replay.restarts_equal();
  done.position_m = replies.position_m();
  done.verdict = tally.verdict();
  done.observed_left_out = replay.feed().observed_left_out();
  done.observed_kept = replay.feed().observed_kept();
  done.text = text.str();
  return done;
}

inline Replayed replay_here(const std::string& bytes, const std::vector<std::string>& set = {},
                            const std::string& never_equal = {}, SceneFileOptions scene_options = {},
                            size_t threads = 1) {
  const auto place = make_local_backend(make_embree_sampler_device(threads));
  return replay_on(*place, open_recording(bytes), set, never_equal, std::move(scene_options));
}

}  // namespace sightline::test
