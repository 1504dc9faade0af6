// The scene files that a recorded session names, found again and brought to where it is replayed: attached to the recording,
// given by path, or below a folder. There they are named by the hash of what was brought, so that a replay needs no folder.
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
  std::string folder = {};  // names are looked up below it, and hashes among all files in it; may be empty
  std::vector<std::string> files = {};  // by path; each is the scene with its file name, or with its hash
  // A scene that is found nowhere keeps its name: the place may have it itself. Else it is an error.
  bool may_be_there = false;
};

// Not thread-safe. The recording must outlive it.
class SceneFiles {
 public:
  SceneFiles(const Recording& recording, SceneFileOptions options)
      : recording_(recording), options_(std::move(options)) {}

  // Brings one file to the place and answers the hash that it has there.
  using Bring = std::function<Result<std::string>(std::span<const std::byte>)>;
  // From now on files go there; what was brought elsewhere is forgotten.
  void bring_to(Bring bring);

  // Brings every scene that is named, and names it by hash. kNotFound (field "scene") when one cannot be found, with what
  // is missing and how to give it; else what reading or bringing it says.
  Status name_by_hash(v1::OpenSession& open);
  // Whether a tick names any; most do not.
  static bool named_in(const v1::Tick& tick);
  Status name_by_hash(v1::Tick& tick);

 private:
  // What a message names: one of the two.
  struct Wanted {
    std::string name, hash;
  };
  // A file somewhere, and the files beside it that it may refer to.
  struct Place {
    std::function<Result<std::vector<std::byte>>()> read;
    std::function<Result<std::vector<std::byte>>(const std::string& relative)> read_beside;
    std::string name;  // for people
  };
  std::vector<Place> places_of(const Wanted& wanted) const;
  void add_attachments(const Wanted& wanted, std::vector<Place>& places) const;
  void add_files(const Wanted& wanted, std::vector<Place>& places) const;
  Result<std::vector<std::byte>> attachment(const std::string& name) const;
  // The hash under which the place has what is wanted; empty: found nowhere, and the place may have it.
  Result<std::string> bring(const Wanted& wanted);
  Status name_by_hash(v1::NewInstance& instance);
  Result<std::string> bring_first(const std::vector<Place>& places, const Wanted& wanted);

  const Recording& recording_;
  const SceneFileOptions options_;
  Bring bring_;
  std::map<std::string, std::string> brought_;  // by name or wanted hash
};

}  // namespace sightline
