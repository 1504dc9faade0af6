// RPC ListScenes: the names that a session can be opened with, in pages.
#pragma once

#include <grpcpp/support/status.h>

#include "server/scene/scene_folder.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

inline constexpr uint32_t kMaxListedScenes = 1000;  // per page; also the default

// Reads the scene folder, which may be on a slow disk. A page's token is the last name of the page before it, so a page
// is right even if files come and go between two calls. INVALID_ARGUMENT names `page_size` when it is over
// kMaxListedScenes.
grpc::Status list_scenes(const SceneLibrary& scenes, const v1::ListScenesRequest& request,
                         v1::ListScenesResponse& response);

}  // namespace sightline
