// The recording of one session: it decides which messages are kept, in which order and with which time.
// server/record/recorder.h writes them to the disk.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <string_view>

#include "server/scene/scene_folder.h"
#include "server/service/log.h"
#include "server/session/session.h"
#include "server/step/step.h"
#include "sightline/v1/camera_control.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

class RecordWriter;
class SessionRecorder;
struct RecordTimes;

// The daemon's options for recordings.
struct RecordingRules {
  RecordWriter* writer = nullptr;  // null: nothing is recorded
  bool all = true;                 // true: unless the client says OFF; false: only when the client says ON
  bool attach_scenes = false;      // true: always; false: when the client asks for it
  // nanoseconds since 1970 (UTC), called once for each session; needed with a writer
  std::function<uint64_t()> wall_ns{};
};

// Calls must not overlap. They cost almost nothing when nothing is recorded. Only the functions that attach scenes wait
// for the disk.
//
// Messages are recorded in the order of the session: a tick when it is applied or refused, then its reply. Times are
// taken from the monotonic clock, plus the offset of the wall clock at the opening. The order therefore stays right
// when the wall clock is set.
class SessionRecording {
 public:
  // All arguments must outlive it. `clock` is the clock of the arrival times.
  SessionRecording(const RecordingRules& rules, const StageClock& clock, SceneLibrary& scenes,
                   const SceneReader& reader, const Log& log);
  ~SessionRecording();

  // Begins the recording when the rules and the request ask for one, and says so in `opened`, whose other fields must
  // be set already. Records both messages. It reads the scene files when they are to be attached, which can take long.
  void open(const v1::OpenSession& request, const Session& session, int64_t arrival_ns, v1::SessionOpened& opened);

  void tick(const v1::Tick& tick, int64_t arrival_ns);
  void rejection(const v1::TickError& rejection);
  // Records the reply; sets its flag `recording_degraded` first when messages are missing in the file.
  void reply(v1::CameraReply& reply);
  // Records what the session carries, every kMemoryEveryS seconds and when the recorder asks. Call it after `reply`,
  // before the next tick.
  void memory(const Session& session);
  static constexpr double kMemoryEveryS = 10.0;
  // Records a failure of the server. `sequence` is the sequence number of the tick, or 0. Never throws.
  void fault(uint64_t sequence, std::string_view stage, std::string_view message) noexcept;

  // True when the tick adds meshes of scenes that must still be attached: reading those can take long.
  bool lacks_scenes(const v1::Tick& tick) const;
  // Called once the tick is applied.
  void attach_scenes(const v1::Tick& tick);

  // Ends the recording. The recorder's thread writes what is still queued.
  void close();

  // The name of its first file within the folder; empty when nothing is recorded.
  const std::string& name() const { return name_; }

 private:
  void attach_scenes(const v1::OpenSession& request, v1::SessionOpened& opened);
  std::string attach(const std::string& scene);
  RecordTimes times(int64_t clock_ns) const;

  const RecordingRules& rules_;
  const StageClock& clock_;
  SceneLibrary& scenes_;
  const SceneReader& reader_;
  const Log& log_;

  std::unique_ptr<SessionRecorder> recorder_;  // null: not recorded
  std::string name_, session_id_;
  int64_t next_memory_ns_ = 0;  // by the clock
  v1::StepMemory memory_;       // reused
  int64_t wall_from_clock_ns_ = 0;
  bool attaches_ = false;
  std::set<std::string> tried_scenes_;    // by name or hash, once each
  std::set<std::string> attached_files_;  // as they are named in the recording
};

}  // namespace sightline
