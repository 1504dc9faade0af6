#include "server/service/list_scenes.h"

namespace sightline {

void list_scenes(const SceneLibrary& scenes, v1::ListScenesReply& reply) {
  for (std::string& name : scenes.names(kMaxListedScenes)) reply.add_names(std::move(name));
}

}  // namespace sightline
