// The parts of the daemon that all RPC handlers share. main builds and owns them.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>

#include "server/base/work_limit.h"
#include "server/gate/credentials.h"
#include "server/sample/extent.h"
#include "server/sample/sampler.h"
#include "server/scene/scene_folder.h"
#include "server/schedule/fair_shares.h"
#include "server/schedule/scheduler.h"
#include "server/schedule/step_budget.h"
#include "server/schedule/step_stats.h"
#include "server/service/log.h"
#include "server/service/session_budget.h"
#include "server/service/session_recording.h"
#include "server/service/session_table.h"
#include "server/service/stream_registry.h"
#include "server/service/worker_pool.h"
#include "server/step/step.h"

namespace sightline {

// Every part must outlive the server.
struct ServiceParts {
  SceneLibrary& scenes;
  GeometryStore& geometry;
  ExtentCache& extents;
  SamplerDevice& sampler;
  Scheduler& scheduler;   // applies ticks and takes steps
  WorkerPool& loaders;    // open sessions, which can take seconds, so that no step waits for that
  WorkerPool& uploaders;  // read uploaded files; apart from the loaders, so that no opening waits for that
  StreamRegistry& streams;
  FairShares& shares;  // of the scheduler's threads
  StepStats& stats;
  SessionTable& sessions;
  const Log& log;
  StageClock clock;       // monotonic, in nanoseconds; for stage and queue times only, since the scheduler has its own
  std::string id_prefix;  // of session ids; differs between daemons
  std::string sampler_reason = {};  // why this sampler was chosen, in words
  BudgetRules budget = {};
  RecordingRules recording = {};
  SessionLimits session_limits = {};
  InstanceMemory* instance_memory = nullptr;  // null: no limit for all sessions together
  const Credentials* credentials = nullptr;   // null: everyone who may connect may speak
  WorkLimit::Rules load = {};                 // of reading one file, or one opening
};

struct ServiceLimits {
  size_t inbox_messages = 256;                   // a stream stops reading when this many messages wait,
  size_t inbox_bytes = size_t{4} << 20;          // or this many bytes
  size_t max_message_bytes = size_t{4} << 20;    // of one message of a Control call
  size_t max_message_memory = size_t{32} << 20;  // of one message, parsed
  size_t messages_memory = size_t{128} << 20;    // of the messages that wait, of all streams together
  size_t max_uploads = 8;                        // at the same time; they hold at most twice max_upload_bytes
  size_t max_upload_bytes = size_t{64} << 20;    // of one file
  size_t max_chunk_bytes = size_t{1} << 20;      // of one message of an upload
  // A Control call whose first message does not come in this time is ended, because it uses up one of the sessions.
  std::chrono::milliseconds open_timeout{10'000};
  // A session without a message for this time is ended. 0: never.
  std::chrono::milliseconds session_idle{300'000};
  // A resumable session is kept for this time after its stream broke. 0: it ends with its stream.
  std::chrono::milliseconds resume_grace{10'000};
  // An upload that sends nothing for this time is ended, because it uses up one of the uploads and a thread.
  std::chrono::milliseconds upload_timeout{60'000};
};

}  // namespace sightline
