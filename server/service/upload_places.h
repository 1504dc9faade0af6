// The uploads in progress: it limits their number and the memory that they hold together.
//
// A place is not kept by an upload that hardly moves. When all places are taken, a new upload takes the place of the slowest one
// that sends less than kLeastBytesPerS.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <list>
#include <mutex>
#include <optional>

namespace sightline {

// Thread-safe. Outlives its places.
class UploadPlaces {
 public:
  static constexpr double kLeastBytesPerS = 16 << 10;
  // An upload is not judged before it is this old.
  static constexpr std::chrono::seconds kFirstJudged{2};

  UploadPlaces(size_t max_uploads, size_t max_bytes) : max_uploads_(max_uploads), max_bytes_(max_bytes) {}

 private:
  struct Upload {
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
    // All bytes have come. False: the place was lost to another upload.
    bool complete();

   private:
    UploadPlaces& places_;
    const Uploads::iterator at_;
  };

  // Takes a place, or none when all are taken by uploads that move. `cancel` is called at most once, from any thread, when
  // the place is lost; it must return at once.
  void take(std::optional<Place>& place, std::function<void()> cancel);

 private:
  friend class Place;
  void make_room();  // needs mutex_

  const size_t max_uploads_, max_bytes_;
  std::mutex mutex_;
  Uploads uploads_;   // guarded by mutex_
  size_t bytes_ = 0;  // of all uploads; guarded by mutex_
};

}  // namespace sightline
