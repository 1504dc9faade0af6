#include "server/service/list_scenes.h"

#include "server/wire/error_to_proto.h"

namespace sightline {

grpc::Status list_scenes(const SceneLibrary& scenes, const v1::ListScenesRequest& request,
                         v1::ListScenesResponse& response) {
  if (request.page_size() > kMaxListedScenes)
    return status_from_error(
        {ErrorCode::kInvalidArgument, "page_size",
         "must be in [0, " + std::to_string(kMaxListedScenes) + "], got " + std::to_string(request.page_size())});
  const size_t size = request.page_size() > 0 ? request.page_size() : kMaxListedScenes;
  std::vector<std::string> names = scenes.names(request.page_token(), size + 1);
  if (names.size() > size) {
    names.resize(size);
    response.set_next_page_token(names.back());
  }
  for (std::string& name : names) response.add_names(std::move(name));
  return grpc::Status::OK;
}

}  // namespace sightline
