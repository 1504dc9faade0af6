// The shot in force: what was asked for (move/asked_shot.h), with its frame as it is now. Internal to this folder.
#pragma once

#include "server/step/stages.h"

namespace sightline {

// A shot with Shot.cut tries to cut for this time.
inline constexpr double kCutWithinS = 0.5;

// The shot of this step: the carried one with its frame turned on, or a new one. The first targets after the opening or
// after a cut begin a shot. So does a shot that the client sends. Targets that join, leave or take turns do not; only
// what was found out about them starts again. A target that is given up still belongs to the set.
WantedShot shot_in_force(const StepInput& input, const TargetsNow& targets, const CarriedState& carried);

// True if the carried shot belongs to the targets with a weight.
bool keeps_shot(const TargetsNow& targets, const WantedShot& before);

// Gives the targets their places in the picture, as seen by a camera of this yaw: the direction counts in which the
// picture leaves room.
void place_in_picture(const StepInput& input, const WantedShot& shot, double camera_yaw_rad, TargetsNow& targets);

// How much the upper edge of the picture keeps its direction from a position, [0, 1]: 1 for a shot from right above, 0
// for others.
double share_from_above(const StepContext& step, const WantedShot& shot, const glm::dvec3& eye_m);
// The picture's rules for the shot in force.
AimRules aim_rules(const StepContext& step);
// The field of view with which a shot that asks for a size and has a lens range keeps the size from a position; empty
// for any other.
std::optional<double> fov_for_size_rad(const StepContext& step, const WantedShot& shot, const glm::dvec3& eye_m);
// The aim at all steered targets. From right above, the picture does not turn about its middle.
Aim aim_with_shot(const StepContext& step, const WantedShot& shot, const glm::dvec3& eye_m, const ViewAngles& present);

// What of the shot a pose gives up. Some target must be steered.
ShotReport report_shot(const StepContext& step, const WantedShot& shot, const CameraState& camera, const Lens& lens,
                       std::span<const TargetSight> sights);

// What hides the targets from the asked place, lately: learns from the maps of the viewpoint search, of one target at a
// time.
void watch_asked_place(const StepContext& step, const TakenMaps& taken, WantedShot& shot);

}  // namespace sightline
