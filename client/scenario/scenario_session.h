// A scenario as the messages of a session: what is sent to open one, and what is sent each tick.
#pragma once

#include <string>

#include "client/scenario/scenario.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Binds every actor, lists the targets, places the camera. The scene is named by the hash that its upload
// answered.
v1::OpenSession open_request(const Scenario& scenario, const std::string& scene_hash, uint64_t seed);

// Poses and velocities of all actors at `time_s`; `step_s` is the length over which velocities are taken.
v1::Tick tick_at(const Scenario& scenario, uint64_t sequence, double time_s, double step_s);

// Between the wire's poses and ours.
void set_pose(const Pose& pose, v1::Pose3* message);
Pose pose_from(const v1::Pose3& message);

}  // namespace sightline
