#include "server/step/shot_in_force.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "server/base/hash.h"
#include "server/move/framing.h"
#include "server/step/opening.h"

namespace sightline {
namespace {

// The time constant with which a shot follows the direction of its frame. A person turns faster than a camera should
// swing round.
constexpr double kFrameS = 0.3;
// The direction of a slower instance says nothing.
constexpr double kTravelsMps = 0.3;
// The place of the first picture is kept if it is farther from the middle than the free band, and not so far that it
// may well be an accident.
constexpr double kKeptPlace = 0.15, kFarthestPlace = 0.5;
// From this elevation on, asked and present, the picture's upper edge keeps its direction: wholly from kAboveBandRad
// higher on. In a session that never asked for a shot, the first pose must look down more steeply. Where the targets
// are aside by more than kMostAside of half a picture, the camera turns to them.
constexpr double kFromAboveRad = 1.2, kAboveBandRad = 0.1, kSurelyAboveRad = 1.4, kMostAside = 0.9, kAsideBand = 0.4;
// A subject of this speed gets all of its lead room. The room grows and shrinks with this time constant.
constexpr double kLeadsAtMps = 1.0, kLeadS = 0.6;
// No target is placed nearer to the edge of the picture, in half pictures.
constexpr double kOutermostPlace = 0.9;
// Less is not worth naming.
constexpr double kHidesShare = 0.05;
// From this far off the asked roll, all of it is lost.
constexpr double kRollLimitRad = std::numbers::pi / 4;
// Farther than any place.
constexpr double kFarthestM = 1e9;

double eased(double share) {
  const double t = std::clamp(share, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

const AskedShot& no_shot() {
  static const AskedShot none;
  return none;
}
const AskedShot& asked_of(const StepInput& input) {
  return input.shot ? *input.shot : no_shot();
}
// The shot by which the picture is composed: none for a camera that stays where it is.
const AskedShot& composed_by(const StepInput& input) {
  return input.settings.move.follow == Follow::kOffset ? asked_of(input) : no_shot();
}

using Subjects = InlineVector<TrackedTarget, kMaxShotSubjects>;

// The subjects that the mirror holds. Empty: the targets are.
Subjects subjects_of(const StepInput& input, const TargetsNow& targets) {
  Subjects subjects;
  for (const uint64_t id : asked_of(input).subject_ids) {
    const auto known = std::ranges::find(targets.ids, id);
    if (known != targets.ids.end())
      subjects.push_back(targets.tracked_targets[static_cast<size_t>(known - targets.ids.begin())]);
    else if (input.scene.find(id))
      subjects.push_back(view_of_instance(input, id));
  }
  return subjects;
}

glm::dvec3 middle_m(const Subjects& subjects, const TargetsNow& targets) {
  if (subjects.empty()) return weighted_center_m(targets.tracked_targets);
  glm::dvec3 sum_m(0.0);
  for (const TrackedTarget& subject : subjects) sum_m += subject.aim_m;
  return sum_m / static_cast<double>(subjects.size());
}

const Instance* frame_instance(const StepInput& input, const TargetsNow& targets) {
  const AskedShot& asked = asked_of(input);
  if (asked.frame_id != 0) return input.scene.find(asked.frame_id);
  for (const uint64_t id : asked.subject_ids)
    if (const Instance* found = input.scene.find(id)) return found;
  for (size_t i = 0; i < targets.ids.size(); ++i)
    if (targets.weighted >> i & 1u) return input.scene.find(targets.ids[i]);
  return nullptr;
}

std::optional<double> heading_of(const Instance& instance, const glm::dvec3& front) {
  return yaw_of(instance.pose.rotation * front);
}

std::optional<double> travel_of(const Instance& instance) {
  const glm::dvec3 level_mps(instance.velocity_mps.x, 0, instance.velocity_mps.z);
  return glm::length(level_mps) > kTravelsMps ? yaw_of(level_mps) : std::nullopt;
}

// The yaw of the frame now; empty where nothing gives it.
std::optional<double> frame_yaw_rad(const StepInput& input, const TargetsNow& targets) {
  const AskedShot& asked = asked_of(input);
  if (asked.frame == ShotFrame::kWorld) return yaw_of(asked.front);
  const Instance* instance = frame_instance(input, targets);
  if (!instance) return std::nullopt;
  if (asked.frame == ShotFrame::kHeading) return heading_of(*instance, asked.front);
  if (asked.frame == ShotFrame::kTravel) return travel_of(*instance);
  const Instance* end = input.scene.find(asked.line_to_id);
  return end ? yaw_of(end->center_m - instance->center_m) : std::nullopt;
}

// The yaw of a frame that begins. Somebody who stands still has the direction of travel that the former shot knew, or
// else a heading.
double first_yaw_rad(const StepInput& input, const TargetsNow& targets, const ShotFrameState& former) {
  const AskedShot& asked = asked_of(input);
  if (const std::optional<double> yaw_rad = frame_yaw_rad(input, targets)) return *yaw_rad;
  const Instance* instance = frame_instance(input, targets);
  if (!instance || asked.frame != ShotFrame::kTravel) return former.yaw_rad;
  if (former.travels_id == instance->id) return former.yaw_rad;
  return heading_of(*instance, asked.front).value_or(former.yaw_rad);
}

void turn_frame(const StepInput& input, const TargetsNow& targets, ShotFrameState& frame) {
  const std::optional<double> now_rad = frame_yaw_rad(input, targets);
  const double dt_s = std::min(input.dt_s, kMaxStepS);
  frame.age_s += dt_s;
  if (!now_rad) return;
  const double share = asked_of(input).frame == ShotFrame::kWorld ? 1.0 : -std::expm1(-dt_s / kFrameS);
  frame.yaw_rad += share * std::remainder(*now_rad - frame.yaw_rad, 2 * std::numbers::pi);
}

// Where the picture leaves room, and how much of it.
glm::dvec3 lead_of(const StepInput& input, const TargetsNow& targets) {
  const AskedShot& asked = asked_of(input);
  const Instance* instance = asked.lead_room > 0 ? frame_instance(input, targets) : nullptr;
  if (!instance) return glm::dvec3(0.0);
  const glm::dvec3 along = asked.lead_by_heading ? instance->pose.rotation * asked.front
                                                 : instance->velocity_mps / kLeadsAtMps;
  const glm::dvec3 level(along.x, 0.0, along.z);
  return level / std::max(glm::length(level), 1.0);
}

void turn_lead(const StepInput& input, const TargetsNow& targets, ShotFrameState& frame) {
  frame.lead += -std::expm1(-std::min(input.dt_s, kMaxStepS) / kLeadS) * (lead_of(input, targets) - frame.lead);
}

// The wanted place now, in the frame.
PlaceInFrame wanted_place(const StepInput& input, const TargetsNow& targets, const Subjects& subjects,
                          const ShotFrameState& frame) {
  const AskedShot& asked = asked_of(input);
  const double share = asked.blend_s > 0 && !asked.cut ? frame.age_s / asked.blend_s : 1.0;
  const double round_rad = asked.orbit_radps * frame.age_s;
  PlaceInFrame to = frame.to;
  if (asked.size) {
    PlaceInFrame angles = blend(frame.from, to, share);
    angles.side_rad += round_rad;
    InlineVector<TrackedTarget, kMaxTargets> steered;
    for (const TrackedTarget& target : targets.tracked_targets)
      if (target.steered()) steered.push_back(target);
    const std::span<const TrackedTarget> bodies = subjects.empty()
                                                      ? std::span<const TrackedTarget>(steered.begin(), steered.size())
                                                      : std::span<const TrackedTarget>(subjects.begin(),
                                                                                       subjects.size());
    to.distance_m = distance_for_size_m(*asked.size, bodies, middle_m(subjects, targets), angles, frame.yaw_rad,
                                        shot_lens(input));
  }
  PlaceInFrame now = blend(frame.from, to, share);
  now.side_rad += round_rad;
  return now;
}

// A place in the frame. Right above or below, the side is the one from which the picture is upright.
PlaceInFrame upright_place(const glm::dvec3& offset_m, double frame_yaw_rad, double up_yaw_rad) {
  PlaceInFrame place = place_in_frame(offset_m, frame_yaw_rad);
  if (!yaw_of(offset_m))
    place.side_rad = place_in_frame(offset_in_frame({std::numbers::pi, 0.0, 1.0}, up_yaw_rad), frame_yaw_rad).side_rad;
  return place;
}

// What was not sent is taken from the former shot, relative to its own subjects, and in the first shot from the camera.
// A blend begins where the former shot's place was.
void begin(const StepInput& input, const TargetsNow& targets, const CarriedState& carried, const Subjects& subjects,
           WantedShot& shot) {
  const AskedShot& asked = asked_of(input);
  const glm::dvec3 from_m = middle_m(subjects, targets), camera_m = carried.camera.pose.position_m;
  const glm::dvec3 former_m = shot.is_set ? shot.asked_offset_m - shot.subjects_m : camera_m - from_m;
  ShotFrameState& frame = shot.frame;
  // A camera that the client puts elsewhere with an observed cut does not jump to a shot that began before.
  shot.cut_s = asked.cut && frame.number != asked.number ? kCutWithinS : 0.0;
  ShotFrameState begun;
  begun.number = asked.number, begun.lead = frame.lead;
  begun.yaw_rad = first_yaw_rad(input, targets, frame);
  if (const Instance* instance = frame_instance(input, targets); instance && asked.frame == ShotFrame::kTravel)
    begun.travels_id = instance->id;
  begun.to = upright_place(former_m, begun.yaw_rad, shot.up_yaw_rad);
  const double camera_rad = upright_place(camera_m - from_m, begun.yaw_rad, shot.up_yaw_rad).side_rad;
  begun.to = {asked.side_rad ? first_side_rad(asked, camera_rad) : begun.to.side_rad,
              asked.height_rad.value_or(begun.to.height_rad), asked.distance_m.value_or(begun.to.distance_m)};
  begun.from = shot.is_set ? upright_place(shot.asked_m - from_m, begun.yaw_rad, shot.up_yaw_rad) : begun.to;
  frame = begun;
}

// Where the targets are in the picture with which a shot begins without places of its own.
std::optional<glm::dvec2> first_place(const StepInput& input, const TargetsNow& targets, const CarriedState& carried) {
  Lens lens = input.lens;
  if (carried.zoom.vertical_fov_rad > 0) lens.vertical_fov_rad = carried.zoom.vertical_fov_rad;
  const glm::dvec2 off = off_place_half_pictures(carried.camera.pose, targets.tracked_targets, lens);
  const double farther = std::max(std::abs(off.x), std::abs(off.y));
  return farther > kKeptPlace && farther <= kFarthestPlace ? std::optional(off) : std::nullopt;
}

void forget_targets(const TargetsNow& targets, WantedShot& shot) {
  shot.viewpoint.reset();
  shot.asked_seen_s = 0.0;
  shot.in_line_m.reset(), shot.line_closed_s = shot.all_kept_s = 0.0;
  shot.at_asked.clear();
  shot.target_set = hash_of(targets, targets.weighted);
}

}  // namespace

bool keeps_shot(const TargetsNow& targets, const WantedShot& before) {
  return before.is_set && before.target_set == hash_of(targets, targets.weighted);
}

WantedShot shot_in_force(const StepInput& input, const TargetsNow& targets, const CarriedState& carried) {
  WantedShot shot = carried.shot;
  if (targets.steered == 0) return shot;
  const AskedShot& asked = asked_of(input);
  const bool begins = !shot.is_set || shot.frame.number != asked.number;
  const Subjects subjects = subjects_of(input, targets);
  const glm::dvec3 center_m = weighted_center_m(targets.tracked_targets);
  if (begins) {
    if (!shot.is_set) {
      shot.place = asked.number == 0 ? first_place(input, targets, carried) : std::nullopt;
      shot.asked_offset_m = carried.camera.pose.position_m - center_m;
      shot.up_yaw_rad = carried.turn.angles.yaw_rad;
    }
    begin(input, targets, carried, subjects, shot);
  } else {
    turn_frame(input, targets, shot.frame);
  }
  turn_lead(input, targets, shot.frame);
  if (begins || !keeps_shot(targets, shot)) forget_targets(targets, shot);
  shot.weight = asked.weight, shot.tolerance = asked.tolerance;
  shot.subjects_m = subjects.empty() ? glm::dvec3(0.0) : middle_m(subjects, targets) - center_m;
  // Without a shot of the client's, the offset stays as it is to the last bit.
  if (asked.number != 0) {
    const PlaceInFrame place = wanted_place(input, targets, subjects, shot.frame);
    shot.frame.now = place;
    shot.frame.now.side_rad = std::remainder(place.side_rad, 2 * std::numbers::pi);
    shot.asked_offset_m = shot.subjects_m + offset_in_frame(place, shot.frame.yaw_rad);
    shot.up_yaw_rad = yaw_of(-offset_in_frame({place.side_rad, 0.0, 1.0}, shot.frame.yaw_rad))
                          .value_or(shot.up_yaw_rad);
  }
  shot.asked_m = center_m + shot.asked_offset_m;
  if (!shot.other_viewpoint()) shot.offset_m = shot.asked_offset_m;
  shot.is_set = true;
  return shot;
}

void place_in_picture(const StepInput& input, const WantedShot& shot, double camera_yaw_rad, TargetsNow& targets) {
  if (input.settings.move.follow == Follow::kStay) return;
  const AskedShot& asked = asked_of(input);
  // The room is on the other side of the target.
  const glm::dvec3 right(std::cos(camera_yaw_rad), 0.0, -std::sin(camera_yaw_rad));
  const double aside = -asked.lead_room * glm::dot(shot.frame.lead, right);
  for (size_t i = 0; i < targets.ids.size(); ++i) {
    TrackedTarget& target = targets.tracked_targets[i];
    if (asked.places.empty()) target.place = shot.place;
    for (const PicturePlace& place : asked.places)
      if (place.id == 0 || place.id == targets.ids[i]) target.place = place.half_pictures;
    if (aside == 0.0 || (!target.place && !asked.places.empty())) continue;
    const glm::dvec2 place = target.place.value_or(glm::dvec2(0.0));
    target.place = glm::dvec2(std::clamp(place.x + aside, -kOutermostPlace, kOutermostPlace), place.y);
  }
}

FramingSettings framing_of(const StepInput& input) {
  FramingSettings framing = input.settings.framing;
  const AskedShot& asked = composed_by(input);
  if (asked.max_vertical_fov_rad > 0)
    framing.min_vertical_fov_rad = asked.min_vertical_fov_rad,
    framing.max_vertical_fov_rad = asked.max_vertical_fov_rad;
  return framing;
}

namespace {

bool zooms_for_size(const StepInput& input) {
  const AskedShot& asked = composed_by(input);
  return asked.size && asked.max_vertical_fov_rad > 0;
}

}  // namespace

Lens shot_lens(const StepInput& input) {
  Lens lens = input.lens;
  const AskedShot& asked = composed_by(input);
  if (zooms_for_size(input))
    lens.vertical_fov_rad = std::clamp(lens.vertical_fov_rad, asked.min_vertical_fov_rad, asked.max_vertical_fov_rad);
  return lens;
}

Lens place_lens(const StepContext& step) {
  return zooms_for_size(step.input) ? shot_lens(step.input) : step.lens;
}

AimRules aim_rules(const StepContext& step) {
  const AskedShot& asked = composed_by(step.input);
  return {.framing = framing_of(step.input),
          .dead_zone = asked.dead_zone,
          .soft_zone = asked.soft_zone,
          .roll_rad = step.roll_rad()};
}

std::optional<double> fov_for_size_rad(const StepContext& step, const WantedShot& shot, const glm::dvec3& eye_m) {
  if (!zooms_for_size(step.input)) return std::nullopt;
  const AskedShot& asked = composed_by(step.input);
  const double asked_m = glm::length(shot.asked_offset_m - shot.subjects_m),
               now_m = glm::distance(eye_m, step.center_m() + shot.subjects_m);
  const double tangent = std::tan(shot_lens(step.input).vertical_fov_rad / 2) * asked_m / std::max(now_m, 1e-6);
  return std::clamp(2 * std::atan(tangent), asked.min_vertical_fov_rad, asked.max_vertical_fov_rad);
}

double share_from_above(const StepContext& step, const WantedShot& shot, const glm::dvec3& eye_m) {
  if (!shot.is_set || step.input.settings.move.follow == Follow::kStay) return 0.0;
  const double asked_above_rad = shot.frame.number != 0 ? kFromAboveRad : kSurelyAboveRad;
  if (elevation_rad(shot.asked_offset_m - shot.subjects_m) < asked_above_rad) return 0.0;
  return eased((elevation_rad(eye_m - step.center_m()) - kFromAboveRad) / kAboveBandRad);
}

Aim aim_with_shot(const StepContext& step, const WantedShot& shot, const glm::dvec3& eye_m, const ViewAngles& present) {
  const std::span<const TrackedTarget> targets = step.targets.tracked_targets;
  AimRules rules = aim_rules(step);
  const Aim plain = aim_at(eye_m, targets, present, step.lens, rules);
  const double above = share_from_above(step, shot, eye_m);
  if (above <= 0) return plain;
  rules.fixed_yaw_rad = shot.up_yaw_rad;
  const Aim upright = aim_at(eye_m, targets, present, step.lens, rules);
  const Pose pose{eye_m, rotation_from_angles(upright.angles)};
  const double aside = std::abs(off_place_half_pictures(pose, targets, step.lens).x);
  const double share = above * eased((kMostAside - aside) / kAsideBand);
  if (share <= 0) return plain;
  rules.fixed_yaw_rad = plain.angles.yaw_rad +
                        share * std::remainder(shot.up_yaw_rad - plain.angles.yaw_rad, 2 * std::numbers::pi);
  return aim_at(eye_m, targets, present, step.lens, rules);
}

namespace {

uint32_t limits_of(const StepContext& step, const glm::dvec3& asked_m) {
  const MoveSettings& settings = step.input.settings.move;
  const glm::dvec3 center_m = step.center_m(), place_m = center_m + asked_m;
  const BrokenLimits broken = broken_limits(place_m, step.targets.tracked_targets, settings);
  uint32_t limits = 0;
  const auto add = [&](ShotLimit limit, bool holds) { limits |= holds ? 1u << static_cast<int>(limit) : 0u; };
  add(ShotLimit::kMaxDistance, broken.distance && glm::length(asked_m) > settings.max_distance_m);
  MoveSettings any_farther = settings;
  any_farther.max_distance_m = kFarthestM;
  add(ShotLimit::kMinDistance, broken_limits(place_m, step.targets.tracked_targets, any_farther).distance);
  const double elevation = elevation_rad(asked_m);
  add(ShotLimit::kMinElevation, broken.elevation && elevation < settings.min_elevation_rad);
  add(ShotLimit::kMaxElevation, broken.elevation && elevation > settings.max_elevation_rad);
  MoveSettings free = settings;
  free.min_distance_m = 0, free.max_distance_m = kFarthestM, free.min_elevation_rad = -2, free.max_elevation_rad = 2;
  const glm::dvec3 fitting_m = desired_place_m(step.targets.tracked_targets, asked_m, place_lens(step),
                                               step.input.settings.framing.framing_margin, free);
  constexpr double kFitSlack = 1.05;
  add(ShotLimit::kPicture, glm::distance(fitting_m, center_m) > kFitSlack * glm::length(asked_m));
  return limits;
}

// Of the required targets, or of all if none is required. Those that are given up are lost.
double lost_sight(const StepContext& step, std::span<const TargetSight> sights) {
  const std::span<const Target> targets = step.input.targets;
  const bool any_required = std::ranges::any_of(targets, [](const Target& of) { return of.weight > 0 && of.required; });
  double lost = 0, all = 0;
  for (size_t i = 0; i < sights.size(); ++i) {
    if (any_required && !targets[i].required) continue;
    lost += targets[i].weight * (1 - sights[i].filtered_share * sights[i].picture_share), all += targets[i].weight;
  }
  return all > 0 ? lost / all : 0.0;
}

// The earliest of those that are expected to hide a target is named. Between two decisions time goes on.
void name_next_hider(const StepContext& step, const AskedSight& sight, ShotReport& report) {
  if (sight.is_hidden) return;
  const double passed_s = step.decides ? 0.0 : step.decision_s;
  for (const Foreseen& foreseen : sight.ahead) {
    const double in_s = std::max(0.0, foreseen.in_s - passed_s);
    if ((report.soon_by != 0 && report.soon_s <= in_s) || !step.input.scene.find(foreseen.by)) continue;
    report.soon_by = foreseen.by, report.soon_target = sight.target_id, report.soon_s = in_s;
  }
}

void name_hider(const StepContext& step, const WantedShot& shot, ShotReport& report) {
  double all = 0, most = kHidesShare;
  for (const AskedSight& sight : shot.at_asked) {
    const auto known = std::ranges::find(step.targets.ids, sight.target_id);
    if (known == step.targets.ids.end()) continue;
    const double weight = step.targets.sight_weights[static_cast<size_t>(known - step.targets.ids.begin())];
    report.hidden_share += weight * sight.hidden, all += weight;
    if (weight <= 0) continue;
    if (step.input.scene.find(sight.by) && sight.hidden > most)
      most = sight.hidden, report.hidden_by = sight.by, report.hidden_target = sight.target_id;
    name_next_hider(step, sight, report);
  }
  report.hidden_share = all > 0 ? report.hidden_share / all : 0.0;
}

}  // namespace

namespace {

glm::dvec2 group_place(const AskedShot& asked, const WantedShot& shot) {
  const auto of_all = std::ranges::find(asked.places, uint64_t{0}, &PicturePlace::id);
  return of_all != asked.places.end() ? of_all->half_pictures : shot.place.value_or(glm::dvec2(0.0));
}

}  // namespace

ShotReport report_shot(const StepContext& step, const WantedShot& shot, const CameraState& camera, const Lens& lens,
                       std::span<const TargetSight> sights) {
  const glm::dvec3 asked_m = shot.asked_offset_m - shot.subjects_m,
                   now_m = camera.pose.position_m - (step.center_m() + shot.subjects_m);
  ShotReport report;
  report.asked = shot.frame.number != 0 ? shot.frame.now : upright_place(asked_m, shot.frame.yaw_rad, shot.up_yaw_rad);
  report.now = place_in_frame(now_m, shot.frame.yaw_rad);
  report.place_m = asked_place_m(step, shot);
  report.group_place = group_place(asked_of(step.input), shot);
  ShotProperties now = shot_from(now_m, lens.vertical_fov_rad);
  now.place_half_pictures = off_place_half_pictures(camera.pose, step.targets.tracked_targets, lens);
  report.off_place = std::max(std::abs(now.place_half_pictures.x), std::abs(now.place_half_pictures.y));
  report.asked_roll_rad = aim_rules(step).roll_rad,
  report.roll_rad = angles_from_rotation(camera.pose.rotation).roll_rad;
  report.roll_deviation = std::min(
      1.0, std::abs(std::remainder(report.roll_rad - report.asked_roll_rad, 2 * std::numbers::pi)) / kRollLimitRad);
  report.deviation = up_to_limits(
      deviation_between(shot_from(asked_m, shot_lens(step.input).vertical_fov_rad), now, shot.tolerance));
  report.sight_loss = lost_sight(step, sights);
  report.worth = picture_worth(report.sight_loss, shot_loss(report.deviation, step.input.settings.move.shot));
  report.limits = limits_of(step, shot.asked_offset_m);
  name_hider(step, shot, report);
  return report;
}

namespace {

// The instance that hides the eye of a map of a single texel from a place; empty if none does.
std::optional<uint64_t> hider_of(const StepContext& step, const TakenMaps& taken, uint32_t map,
                                 const glm::dvec3& place_m) {
  if (taken.map_falls_short_m(map, place_m) <= 0) return std::nullopt;
  return step.input.scene.instances()[taken.maps[map].occluder_at(0, 0)].id;
}

// The target's entry, which is made if it is new; null: there is no room.
AskedSight* sight_of(uint64_t target_id, WantedShot& shot) {
  const auto known = std::find_if(shot.at_asked.begin(), shot.at_asked.end(),
                                  [target_id](const AskedSight& of) { return of.target_id == target_id; });
  if (known != shot.at_asked.end()) return known;
  if (shot.at_asked.size() == kMaxTargets) return nullptr;
  shot.at_asked.push_back({.target_id = target_id, .ahead = {}});
  return shot.at_asked.end() - 1;
}

// Time passes for what was foreseen. A slice that is looked at again is forgotten first.
void pass_time(double passed_s, std::span<const SightAhead> looks, size_t target, AskedSight& sight) {
  InlineVector<Foreseen, kSlices> kept;
  for (Foreseen foreseen : sight.ahead) {
    foreseen.in_s -= passed_s;
    const bool again = std::ranges::any_of(looks, [&](const SightAhead& look) {
      return look.target == target && std::abs(look.ahead_s - foreseen.in_s) < 0.5 * kSliceS;
    });
    if (foreseen.in_s >= 0 && !again) kept.push_back(foreseen);
  }
  sight.ahead = kept;
}

// Only some of the slices are looked at in a step. What was found at the others holds until they are looked at again.
void look_ahead(const StepContext& step, const TakenMaps& taken, WantedShot& shot) {
  const std::span<const SightAhead> looks(taken.plan.look.ahead.begin(), taken.plan.look.ahead.size());
  for (size_t i = 0; i < step.target_count(); ++i) {
    AskedSight* sight = sight_of(step.targets.ids[i], shot);
    if (!sight) continue;
    if (step.is_steered(i))
      pass_time(step.decision_s, looks, i, *sight);
    else
      sight->ahead.clear();
  }
  for (const SightAhead& look : looks) {
    const std::optional<uint64_t> by = hider_of(step, taken, look.map, look.place_m);
    AskedSight* sight = by ? sight_of(step.targets.ids[look.target], shot) : nullptr;
    if (sight && sight->ahead.size() < kSlices) sight->ahead.push_back({look.ahead_s, *by});
  }
}

}  // namespace

void watch_asked_place(const StepContext& step, const TakenMaps& taken, WantedShot& shot) {
  const ViewpointLook& look = taken.plan.look;
  if (!look.searches) return shot.at_asked.clear();
  if (step.move_s <= 0) return;
  look_ahead(step, taken, shot);
  if (!step.is_steered(look.target)) return;
  AskedSight* sight = sight_of(step.targets.ids[look.target], shot);
  if (!sight) return;
  const double memory_s = step.input.settings.move.viewpoint_search.memory_s;
  const double newest = -std::expm1(-step.decision_s * static_cast<double>(step.target_count()) / memory_s);
  const std::optional<uint64_t> by = hider_of(step, taken, look.asked_sight, asked_place_m(step, shot));
  sight->hidden += newest * ((by ? 1.0 : 0.0) - sight->hidden);
  sight->is_hidden = by.has_value();
  if (by) sight->by = *by;
}

}  // namespace sightline
