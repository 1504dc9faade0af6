// The uploads in progress: it limits their number and the memory that they hold together.
//
// A place is not kept by an upload that hardly moves. When all places are taken, a new upload takes the place of the
// slowest one that sends less than kLeastBytesPerS. One client has at most half of the places, and an upload that is
// slower than kSlowestBytesPerS for long is late, whether or not somebody waits.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <functional>
#include <list>
#include <optional>
#include <string>

#include "server/base/mutex.h"

namespace sightline {

// Thread-safe. Outlives its places.
class UploadPlaces {
 public:
  static constexpr double kLeastBytesPerS = 16 << 10;
  // An upload is not judged before it is this old.
  static constexpr std::chrono::seconds kFirstJudged{2};

  // An upload may take kUnhurried, and in addition the time that its bytes take at this rate.
  static constexpr double kSlowestBytesPerS = 64 << 10;
  static constexpr std::chrono::seconds kUnhurried{60};
  static bool is_late(size_t bytes, std::chrono::duration<double> age) {
    return age - kUnhurried > std::chrono::duration<double>(static_cast<double>(bytes) / kSlowestBytesPerS);
  }

  UploadPlaces(size_t max_uploads, size_t max_bytes) : max_uploads_(max_uploads), max_bytes_(max_bytes) {}

 private:
  struct Upload {
    std::string client;
    std::function<void()> cancel;
    std::chrono::steady_clock::time_point since;
    size_t bytes = 0;
    bool complete = false;   // all bytes have come, and the file is being read
    bool displaced = false;  // another upload has its place
  };
  using Uploads = std::list<Upload>;

 public:
  // The place of one upload, given back at the end of its life.
  class Place {
   public:
    Place(UploadPlaces& places, Uploads::iterator at) : places_(places), at_(at) {}
    ~Place();
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    // Counts bytes that have come. False: the uploads hold too much memory together.
    bool add(size_t bytes);
    // True when the upload has taken too long for the bytes that have come.
    bool late() const;
    // All bytes have come. False: the place was lost to another upload.
    bool complete();

   private:
    UploadPlaces& places_;
    const Uploads::iterator at_;
  };

  // Most uploads of one client.
  size_t max_of_client() const { return std::max<size_t>(1, max_uploads_ / 2); }
  // Ends all uploads, now and from now on: the server is shutting down.
  void end_all();
  bool ended() const;
  // Takes a place, or none when all that `client` may have are taken by uploads that move. `cancel` is called at most
  // once, from any thread, when the place is lost; it must return at once.
  void take(std::optional<Place>& place, const std::string& client, std::function<void()> cancel);

 private:
  friend class Place;
  // Null: any client.
  size_t held_by(const std::string* client) const NEEDS(mutex_);
  void make_room(const std::string* client) NEEDS(mutex_);

  const size_t max_uploads_, max_bytes_;
  mutable Mutex mutex_;
  bool ended_ GUARDED(mutex_) = false;
  Uploads uploads_ GUARDED(mutex_);
  size_t bytes_ GUARDED(mutex_) = 0;  // of all uploads
};

}  // namespace sightline
