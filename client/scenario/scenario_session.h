// A scenario as the messages of a session: the request that opens it, and the ticks.
#pragma once

#include <string>

#include "client/scenario/scenario.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Binds every actor, lists the targets and places the camera. `scene_hash` is what the scene's upload answered.
v1::OpenSession open_request(const Scenario& scenario, const std::string& scene_hash, uint64_t seed);

// Poses and velocities of all actors at `time_s`; velocities are taken over `step_s`.
v1::Tick tick_at(const Scenario& scenario, uint64_t sequence, double time_s, double step_s);

// Converts between poses of the contract and our own.
void set_pose(const Pose& pose, v1::Pose3* message);
Pose pose_from(const v1::Pose3& message);

}  // namespace sightline
