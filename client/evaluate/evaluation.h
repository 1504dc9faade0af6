// Plays scenes under camera policies in this process and judges every run: what `sightline evaluate` does.
//
// Everything but RunTiming is a pure function of scenes, policies and options: it is the same on every run and for any
// number of jobs.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/evaluate/policy.h"
#include "client/truth/changes.h"
#include "client/truth/coherence.h"
#include "client/truth/metrics.h"
#include "client/truth/reaction.h"
#include "client/truth/turns.h"

namespace sightline {

// One scenario at one seed. `load` is called on any thread.
struct SceneCase {
  std::string name;   // as tables show it: "hall", "arena-4"
  uint64_t seed = 1;  // of the scene, and of the sessions that play in it
  std::function<Result<Scenario>(GeometryStore&)> load;
};

struct EvaluationOptions {
  double rate_hz = 60.0;    // ticks per second of scenario time, (0, 1000]
  double duration_s = 0.0;  // longest part of each scenario to play; 0: all of it
  int picture_every = 6;    // >= 1; every n-th frame's picture is judged
  int picture_size = kTruthSize;
  // folder for a contact sheet of each run, <scene>-<seed>-<policy>.jpg; it must exist. Empty: none
  std::string sheets = {};
  int jobs = 1;  // number of threads, >= 1
  // Takes the maps of Sightline's own policies, on several threads; must outlive the call. Null: Embree.
  SamplerDevice* samplers = nullptr;
  // Called with the share that is done, in [0, 1], on any of the threads, one call at a time.
  std::function<void(double)> progress;
};

// Wall-clock times: different on every run.
struct RunTiming {
  double run_s = 0.0;    // playing and judging
  double step_ms = 0.0;  // mean time of one call of the policy, including the scene's own movement
};

// One judged picture.
struct JudgedPicture {
  double time_s = 0.0;
  glm::dvec3 camera_m{0.0};
  double least_whole_share = 0.0;  // TargetTruth::whole_share of the target that is shown least
  bool lost = false;               // no pixel of any target is visible
  std::optional<bool> tracking;    // whether the policy's status was TRACKING; none without a status
};

struct RunRecord {
  std::string scene;
  uint64_t seed = 0;
  size_t target_count = 0;
  std::string policy;
  RunMetrics metrics;
  // Reactions, turns and obstructions follow single targets: all 0 where the targets change.
  ReactionMetrics reaction;
  TurnMetrics turns;
  CoherenceMetrics coherence;
  ChangeMetrics changes;                  // of targets
  double longest_blind_with_way_s = 0.0;  // client/truth/free_way.h
  // Only for policies that say what they see, what their status is, and where they head.
  std::optional<ReportMetrics> reports;
  std::optional<StatusMetrics> status;
  std::optional<GoalMetrics> goals;
  ObstructionCounts obstructions;                // of the asked place; only of policies that say where it is
  ReasonCounts reasons;                          // by claims of places, at the judged pictures
  std::optional<double> pair_volume_share;       // share of the frames with PolicyStep::pair_volume
  std::optional<double> most_joint, most_worth;  // only for policies that know them (policy.h)
  std::vector<JudgedPicture> pictures;
  RunTiming timing;
};

// One record a run: the scene cases in their order, and within each case the policies in theirs.
//
// Errors: a scene that cannot be loaded or has no target with a weight, a policy that cannot start or step. The error's
// field begins with "<scene> seed <n>", or with "<policy> in <scene> seed <n>" when the policy failed.
Result<std::vector<RunRecord>> evaluate(std::span<const SceneCase> cases, std::span<const PolicyEntry> policies,
                                        const EvaluationOptions& options);

}  // namespace sightline
