// What the RPC handlers share: built and owned by main, handed over by reference.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>

#include "server/schedule/fair_shares.h"
#include "server/service/log.h"
#include "server/schedule/scheduler.h"
#include "server/service/session_recording.h"
#include "server/schedule/step_budget.h"
#include "server/schedule/step_stats.h"
#include "server/service/stream_registry.h"
#include "server/service/worker_pool.h"
#include "server/sample/extent.h"
#include "server/sample/sampler.h"
#include "server/scene/scene_folder.h"
#include "server/step/step.h"

namespace sightline {

// Every part must outlive the server.
struct ServiceParts {
  SceneLibrary& scenes;
  GeometryStore& geometry;
  ExtentCache& extents;
  SamplerDevice& sampler;
  Scheduler& steppers;   // apply ticks and take steps
  WorkerPool& loaders;   // read scenes and open sessions, which may take seconds: never ahead of a step
  StreamRegistry& streams;
  FairShares& shares;  // of the steppers' time
  StepStats& stats;
  Log& log;
  StageClock clock;  // nanoseconds, monotonic; for stage and queue times only: the scheduler has its own
  std::string id_prefix;            // of session ids; differs between daemons
  std::string sampler_reason = {};  // why it is this sampler, for people
  BudgetRules budget = {};
  RecordingRules recording = {};
};

struct ServiceLimits {
  size_t inbox_messages = 256;                  // a stream stops reading when so many wait
  size_t inbox_bytes = size_t{4} << 20;         // or so many bytes
  size_t max_uploads = 4;                       // at the same time
  size_t max_upload_bytes = size_t{256} << 20;  // of one file
  size_t max_chunk_bytes = size_t{1} << 20;     // of one message of an upload
  // A Control call that has sent no message for so long ends: it holds the place of a session.
  std::chrono::milliseconds open_timeout{10'000};
  // An upload that has sent nothing for so long ends: it holds a place and a thread.
  std::chrono::milliseconds upload_timeout{60'000};
};

}  // namespace sightline
