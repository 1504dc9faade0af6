// The scene files of a recording, wherever they are now: its own attachments, a folder, files by hand. What is missing
// is stood in for, so that the rest can still be shown.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "client/local_session.h"
#include "client/recording.h"

namespace sightline {

struct ScenePlaces {
  std::string folder;              // of scenes by name, as the daemon's --scene-dir; empty: none
  std::vector<std::string> files;  // found by the hash of what they hold
};

// A world with the scenes of a recording in it. Holds them as long as it lives.
class RecordedScenes {
 public:
  // Where named files are attached the folder is not looked at. Fails when a file of `places` cannot be read.
  static Result<std::unique_ptr<RecordedScenes>> find(const Recording& recording, const ScenePlaces& places,
                                                      SamplerDevice& sampler);
  ~RecordedScenes();
  RecordedScenes(const RecordedScenes&) = delete;
  RecordedScenes& operator=(const RecordedScenes&) = delete;

  // What of the attachments cannot be used, and why.
  const std::vector<std::string>& troubles() const { return troubles_; }

  LocalWorld& world() { return *world_; }
  // Why a scene or mesh file that messages name cannot be had; ok when it can.
  Status look_up(const v1::SceneRef& scene);
  Status look_up(const v1::MeshRef& mesh);
  // Null when it cannot be had.
  std::shared_ptr<const SceneAsset> asset(const v1::SceneRef& scene);

 private:
  RecordedScenes() = default;
  Status unpack(const RecordedFile& file);
  Status add_upload(std::span<const std::byte> bytes, const std::string& name);
  Result<std::shared_ptr<const SceneAsset>> load(bool by_hash, const std::string& key);

  std::string folder_;
  std::filesystem::path unpacked_;  // a folder of its own for attached named files; empty: none
  std::unique_ptr<LocalWorld> world_;
  std::vector<std::shared_ptr<const SceneAsset>> held_;
  std::vector<std::string> troubles_;
};

}  // namespace sightline
