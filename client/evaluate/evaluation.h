// Scenes x policies, each run played and judged in this process: what `sightline evaluate` does.
//
// Everything here but RunTiming is a pure function of scenes, policies and options: the same on every run,
// whatever the number of jobs.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/evaluate/policy.h"
#include "client/truth/reaction.h"

namespace sightline {

// One scenario at one seed. `load` is called on any thread.
struct SceneCase {
  std::string name;   // as tables show it: "hall", "arena-4"
  uint64_t seed = 1;  // of the scene, and of the sessions that play in it
  std::function<Result<Scenario>(GeometryStore&)> load;
};

struct EvaluationOptions {
  double rate_hz = 60.0;    // ticks a second of scenario time, (0, 1000]
  double duration_s = 0.0;  // at most this much of each scenario; 0: all of it
  int picture_every = 6;    // >= 1; judge every n-th frame's picture
  int picture_size = kTruthSize;
  int jobs = 1;  // >= 1 threads
  // The share done, in [0, 1]; one call at a time, on any of the threads.
  std::function<void(double)> progress;
};

struct RunTiming {
  double run_s = 0.0;    // playing and judging
  double step_ms = 0.0;  // mean time of one call of the policy, the scene's own movement included
};

// The least visible share of any target in one judged picture.
struct JointSight {
  double time_s = 0.0;
  double least_share = 0.0;
};

struct RunRecord {
  std::string scene;
  uint64_t seed = 0;
  size_t target_count = 0;
  std::string policy;
  RunMetrics metrics;
  ReactionMetrics reaction;
  std::optional<ReportMetrics> words;  // of policies that say what they see
  std::vector<JointSight> sights;
  double rate_hz = 60.0;
  std::vector<glm::dvec3> path_m;  // of the camera, by frame, at that rate
  RunTiming timing;
};

// Straight pieces on the floor plan: world x and z, metres.
struct PlanSegment {
  glm::dvec2 from_m{0.0}, to_m{0.0};
};

// A scene as its plots show it: colliders cut by the level plane through the targets' centre at the start,
// and the targets' ways.
struct ScenePlan {
  std::string scene;
  uint64_t seed = 0;
  std::vector<PlanSegment> walls;                  // what stands still
  std::vector<PlanSegment> movers;                 // what moves and is no target, where it is at the start
  std::vector<std::vector<glm::dvec2>> targets_m;  // ten places a second, by target
};

struct Evaluation {
  std::vector<ScenePlan> plans;  // a scene case each, in their order
  std::vector<RunRecord> runs;   // scene cases in their order; within each the policies in theirs
};

// Errors: a scene that cannot be loaded or has no target with a weight, a policy that cannot start or step.
// The error's field begins with "<scene> seed <n>", and of a policy "<policy> in <scene> seed <n>".
Result<Evaluation> evaluate(std::span<const SceneCase> cases, std::span<const PolicyEntry* const> policies,
                            const EvaluationOptions& options);

// The pieces in which the instances' triangles meet the level plane y = height_m. `moving`: only those that
// move and are none of `targets`, else only those that stand still.
std::vector<PlanSegment> cut_level(const SceneMirror& mirror, double height_m, bool moving,
                                   std::span<const Target> targets);

}  // namespace sightline
