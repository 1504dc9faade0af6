// One session's recording, or none: which messages go into it, when, and with what time. Where they go from here, and
// what becomes of them when the disk is full, is server/record/recorder.h.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <string_view>

#include "server/service/log.h"
#include "server/scene/scene_folder.h"
#include "server/step/step.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

class RecordWriter;
class SessionRecorder;
struct RecordTimes;

// What the daemon records.
struct RecordingRules {
  RecordWriter* writer = nullptr;       // null: nothing
  bool all = true;                      // every session whose client does not say OFF; else those that say ON
  bool attach_scenes = false;           // always, not only when asked
  std::function<uint64_t()> wall_ns{};  // since 1970 (UTC); asked once a session, needed with a writer
};

// Its calls must not overlap, and cost next to nothing when nothing is recorded. None waits for the disk but those
// that attach scenes.
//
// Messages are told in the order of the session: a tick as it is applied or refused, then what is answered. Their time
// is that of the clock, moved to the wall's by what both said at the opening: a wall clock that is set meanwhile does
// not turn them round.
class SessionTape {
 public:
  // All must outlive it; `clock` is the one that arrival times are of.
  SessionTape(const RecordingRules& rules, const StageClock& clock, SceneLibrary& scenes, const Log& log);
  ~SessionTape();

  // A session has opened. Begins the recording when it is to be one, says so in `opened`, which must hold everything
  // else already, and keeps both. Reads the scene files when they are to be attached: on a thread that may take long.
  void open(const v1::OpenSession& request, int64_t arrival_ns, v1::SessionOpened& opened);

  void tick(const v1::Tick& tick, int64_t arrival_ns);
  void rejection(const v1::TickError& rejection);
  // Flags the reply when something is missing in the file, then keeps it.
  void reply(v1::CameraReply& reply);
  // Keeps what went wrong in the server; `sequence`: of the tick, 0 for none. Never throws.
  void fault(uint64_t sequence, std::string_view stage, std::string_view message) noexcept;

  // Whether the tick adds meshes of scenes that are to be attached and are not yet: reading them may take long.
  bool lacks_scenes(const v1::Tick& tick) const;
  // To be called once the tick is applied.
  void attach_scenes(const v1::Tick& tick);

  // Nothing more comes; what came is written, by others.
  void close();

  // The file of its first part, within the folder; empty: not recorded.
  const std::string& name() const { return name_; }

 private:
  void attach_scenes(const v1::OpenSession& request, v1::SessionOpened& opened);
  std::string attach(const std::string& scene);
  RecordTimes times(int64_t clock_ns) const;

  const RecordingRules& rules_;
  const StageClock& clock_;
  SceneLibrary& scenes_;
  const Log& log_;

  std::unique_ptr<SessionRecorder> recorder_;  // null: not recorded
  std::string name_, session_id_;
  int64_t wall_from_clock_ns_ = 0;
  bool attaches_ = false;
  std::set<std::string> tried_scenes_;    // by name or hash, once each
  std::set<std::string> attached_files_;  // as they are named in the recording
};

}  // namespace sightline
