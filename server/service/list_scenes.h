// RPC ListScenes: the names that a session can be opened with.
#pragma once

#include "server/scene/scene_folder.h"
#include "sightline/v1/scene.pb.h"

namespace sightline {

inline constexpr size_t kMaxListedScenes = 1000;

// Reads a folder, which may be on a slow disk.
void list_scenes(const SceneLibrary& scenes, v1::ListScenesReply& reply);

}  // namespace sightline
