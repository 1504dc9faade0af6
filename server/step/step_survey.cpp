// The survey in a step: one target looks round (sample), the places learn from it (aggregate), and the shot to want is chosen.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "server/base/random.h"
#include "server/step/step_work.h"

namespace sightline {
namespace {

// A shot is chosen in every fourth step: it is to hold for seconds.
constexpr uint64_t kStepsPerChoice = 4;
// The survey is believed once it lasted for this share of its memory.
constexpr double kKnownShare = 0.5;
// Points of the targets' boxes that look round: this share of the box, since its corners are mostly outside the shape.
constexpr double kBoxShare = 0.7;
// A shot that the framing would push out by more than this share does not show the whole group.
constexpr double kFitSlack = 1.05;

bool surveys(const StepWork& w) {
  const MoveSettings& settings = w.input.settings.move;
  return settings.strategy == Strategy::kMinCost && settings.search_viewpoints &&
         settings.follow == Follow::kOffset && w.steered != 0;
}

glm::dvec3 looking_point_m(const Instance& instance, CounterRandom& random) {
  const Aabb& box = instance.geometry->bounds;
  const double x = random.next_unit(), y = random.next_unit(), z = random.next_unit();
  const glm::dvec3 from_center =
      (glm::dvec3(x, y, z) - 0.5) * glm::dvec3(box.half_extent()) * 2.0 * kBoxShare;
  return transform_point(instance.world_from_instance, glm::dvec3(box.center()) + from_center);
}

glm::dvec3 shot_offset_m(const StepWork& w, const glm::dvec3& offset_m) {
  return desired_place_m(w.memory.target_views, offset_m, w.lens, w.input.settings.framing.framing_margin,
                         w.input.settings.move) -
         weighted_center_m(w.memory.target_views);
}

// The shot that looks at the targets' centre from there, all of them seen.
void capture(const StepWork& w, const glm::dvec3& offset_m, ShotState& shot) {
  std::array<float, kMaxTargets> seen;
  seen.fill(1.0f);
  const glm::dvec3 center_m = weighted_center_m(w.memory.target_views);
  capture_shot(pose_of_shot(center_m, offset_m), w.lens, w.memory.target_views,
               std::span<const float>(seen).first(w.input.targets.size()), shot);
}

void choose(StepWork& w) {
  ShotSearch& shot = w.memory.shot;
  const MoveSettings& settings = w.input.settings.move;
  const glm::dvec3 center_m = weighted_center_m(w.memory.target_views),
                   present_m = w.memory.camera.pose.position_m - center_m;
  if (glm::length(present_m) < 1e-6 || glm::length(shot.asked_offset_m) < 1e-6) return;
  capture(w, shot_offset_m(w, shot.asked_offset_m), shot.asked);
  capture(w, present_m, shot.present);
  ViewpointSearchSettings survey = settings.viewpoint_search;
  if (!targets_stand(w)) survey.keep_shot_below = 0;
  const auto allowed = [&](const glm::dvec3& offset_m) {
    return within_limits(center_m + offset_m, w.memory.target_views, settings) &&
           glm::length(shot_offset_m(w, offset_m)) <= kFitSlack * glm::length(offset_m);
  };
  shot.asked_place = shot.survey.nearest_place(shot.asked.from_center_m);
  shot.place = choose_shot(shot.survey, w.memory.target_views, shot.asked, shot.asked_place, shot.present,
                           shot.place.value_or(shot.asked_place), survey, settings.coherence, std::cref(allowed));
}

// What the survey's third of four distances is.
double survey_distance_m(const StepWork& w) {
  return std::max(glm::length(shot_offset_m(w, w.memory.shot.asked_offset_m)), 0.1);
}

// What was learnt is old when the survey comes on again, and without one the camera wants the shot that it was asked for.
void stop_survey(StepWork& w) {
  ShotSearch& shot = w.memory.shot;
  shot.survey.forget();
  if (shot.place) w.memory.desired_offset_m = shot.asked_offset_m;
  shot.place.reset();
}

}  // namespace

void plan_survey(StepWork& w) {
  ShotSearch& shot = w.memory.shot;
  shot.maps = {};
  if (!surveys(w)) return stop_survey(w);
  shot.looking = w.input.tick % w.input.targets.size();
  CounterRandom random(w.input.seed, w.input.tick, RandomPurpose::kSurveyPoint);
  const Instance& instance = *w.input.scene.find(w.input.targets[shot.looking].instance_id);
  const glm::dvec3 eye_m = looking_point_m(instance, random);
  const double x = random.next_unit(), y = random.next_unit();
  shot.maps.first = static_cast<uint32_t>(w.memory.views.size());
  plan_round(eye_m, w.input.settings.move.viewpoint_search.resolution, {x, y}, w.memory.views);
  shot.maps.count = static_cast<uint32_t>(w.memory.views.size()) - shot.maps.first;
}

void request_survey(StepWork& w) {
  const ShotSearch& shot = w.memory.shot;
  const glm::dvec3 center_m = weighted_center_m(w.memory.target_views);
  for (uint32_t view = shot.maps.first; view < shot.maps.first + shot.maps.count; ++view)
    w.memory.requests[view] = {.view = w.memory.views[view],
                               .layer_mask = w.input.targets[shot.looking].layer_mask,
                               .far_m = beyond_all_m(glm::distance(w.memory.views[view].eye_m, center_m) +
                                                     Survey::kFarthestShare * survey_distance_m(w)),
                               .ignored_slots = w.memory.ignored_slots[shot.looking]};
}

void learn_survey(StepWork& w) {
  ShotSearch& shot = w.memory.shot;
  if (shot.maps.count == 0 || w.move_s <= 0) return;
  const AggregateSettings& settings = w.input.settings.aggregate;
  shot.survey.follow(w.memory.target_ids, survey_distance_m(w));
  shot.survey.learn(shot.looking, std::span(w.memory.maps).subspan(shot.maps.first, shot.maps.count),
                    weighted_center_m(w.memory.target_views), settings.relative_bias,
                    w.move_s * static_cast<double>(w.input.targets.size()),
                    w.input.settings.move.viewpoint_search.memory_s);
  const bool knows = shot.survey.known_s() >= kKnownShare * w.input.settings.move.viewpoint_search.memory_s;
  if (knows && w.input.tick % kStepsPerChoice == 0) choose(w);
  if (!shot.place) return;
  // The survey's places are coarse: the one that is most like the shot that was asked for is taken for that shot itself.
  w.memory.desired_offset_m =
      *shot.place == shot.asked_place ? shot.asked_offset_m : shot.survey.offset_m(*shot.place);
}

}  // namespace sightline
