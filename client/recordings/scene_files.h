// Finds the scene files that a recorded session names, and brings them to where it is replayed. They may be attached to
// the recording, given by path, or below a folder. The messages are then changed to name each scene by the hash of its
// file, so that the replay needs no scene folder.
#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "client/recordings/recording.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

struct SceneFileOptions {
  std::string folder = {};              // names are looked up below it, and hashes among all files in it; may be empty
  std::vector<std::string> files = {};  // by path; each is the scene with its file name, or with its hash
  // true: a scene that is found nowhere keeps its name, since the backend may have it. false: it is an error.
  bool may_be_there = false;
};

// Not thread-safe. The recording must outlive it.
class SceneFiles {
 public:
  SceneFiles(const Recording& recording, SceneFileOptions options)
      : recording_(recording), options_(std::move(options)) {}

  // Brings one file to the backend and returns the hash that it has there.
  using Bring = std::function<Result<std::string>(std::span<const std::byte>)>;
  // Files go there from now on; what was brought elsewhere is forgotten.
  void bring_to(Bring bring);

  // Brings every scene that the message names, and names it by hash. Fails with kNotFound (field "scene") when one
  // cannot be found; the message says how to give it. Otherwise fails as reading or bringing fails.
  Status name_by_hash(v1::OpenSession& open);
  // True when the tick names a scene; most do not.
  static bool named_in(const v1::Tick& tick);
  Status name_by_hash(v1::Tick& tick);

 private:
  // How a message names a scene: by one of the two.
  struct Wanted {
    std::string name, hash;
  };
  // A file that may be the scene, and the files next to it that it may refer to.
  struct Place {
    std::function<Result<std::vector<std::byte>>()> read;
    std::function<Result<std::vector<std::byte>>(const std::string& relative)> read_beside;
    std::string name;  // for messages
  };
  std::vector<Place> places_of(const Wanted& wanted) const;
  void add_attachments(const Wanted& wanted, std::vector<Place>& places) const;
  void add_files(const Wanted& wanted, std::vector<Place>& places) const;
  Result<std::vector<std::byte>> attachment(const std::string& name) const;
  // The hash of the scene at the backend; empty: it was found nowhere, and the backend may have it.
  Result<std::string> bring(const Wanted& wanted);
  Status name_by_hash(v1::NewInstance& instance);
  Result<std::string> bring_first(const std::vector<Place>& places, const Wanted& wanted);

  const Recording& recording_;
  const SceneFileOptions options_;
  Bring bring_;
  std::map<std::string, std::string> brought_;  // by name or wanted hash
};

}  // namespace sightline
