// The open sessions and what their cameras show, for operators who ask whether the cameras are good right now.
//
// Times are those that the camera moves for, in seconds of the game: a paused game adds nothing, and a step counts for
// at most kMaxStepS. A target counts here if it is required and has a weight. If no target is required, all that have a
// weight count.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <string>
#include <vector>

#include "server/base/mutex.h"
#include "server/session/session.h"

namespace sightline {

inline constexpr size_t kTrackingStatuses = static_cast<size_t>(TrackingStatus::kHolding) + 1;
// True for the statuses in which nothing of any target is seen.
bool is_blind(TrackingStatus status);

// What cameras showed, summed over time.
struct CameraSums {
  std::array<double, kTrackingStatuses> status_s{};  // by TrackingStatus
  double target_s = 0.0;                             // the targets that count, times seconds
  double shown_s = 0.0;      // the same, times the share of each target that the picture shows, hidden or cut off alike
  double shot_s = 0.0;       // in which a shot was wanted of some target
  double shot_kept_s = 0.0;  // of it, with side, height and size within their free bands (ShotReport)
  double worth_s = 0.0;      // shot_s times the worth of the pictures
  uint64_t cuts = 0;         // cuts that the server chose

  CameraSums& operator+=(const CameraSums& other);
};

// One open session, as a row of the table.
struct SessionRow {
  std::string id, label, client;
  uint64_t number = 0;    // in the order of the openings, from 1
  int64_t opened_ns = 0;  // by the clock of the steps
  int64_t moved_ns = 0;   // by the same clock: when a step last took the game on, or the opening
  uint64_t steps = 0;
  int quality_level = 0;                             // of the last step
  TrackingStatus status = TrackingStatus::kHolding;  // of the last step
  double blind_s = 0.0;                              // nothing of any target has been seen for this time
  CameraSums sums = {};                              // since it was opened
};

// Thread-safe.
class SessionTable {
  using Rows = std::list<SessionRow>;

 public:
  // Keeps one session in the table. Not thread-safe. The table must outlive it.
  class Place {
   public:
    Place(SessionTable& table, Rows::iterator row) : table_(table), row_(row) {}
    ~Place() { table_.erase(row_); }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;

    // Takes note of a step. `targets` are those of its answer, in the same order. `now_ns` is by the clock of the
    // steps.
    void add(const SessionAnswer& answer, const std::vector<Target>& targets, int64_t now_ns);

   private:
    SessionTable& table_;
    const Rows::iterator row_;
  };

  std::unique_ptr<Place> open(std::string id, std::string label, std::string client, int64_t now_ns);

  // Sessions in the order of their opening, at most so many, and only those with a number greater than `after`.
  std::vector<SessionRow> rows(uint64_t after = 0, size_t at_most = SIZE_MAX) const;
  // Of all sessions since the start, those that have ended included.
  CameraSums sums() const;
  struct Now {
    // Open sessions that have had a step, by the status of the last one.
    std::array<uint64_t, kTrackingStatuses> by_status{};
    uint64_t blind = 0;  // those that have been blind for kLongBlindS or longer
    // The longest time for which one of them has been blind. A session whose game has stood still for kStandsStillS has
    // no part in it: its blind time does not grow, and would hide the others' times.
    double longest_blind_s = 0.0;
  };
  Now now(int64_t now_ns) const;

  static constexpr double kLongBlindS = 2.0;
  static constexpr double kStandsStillS = 5.0;  // of the steps' clock, without a step that takes the game on

 private:
  void add(SessionRow& row, const SessionAnswer& answer, const CameraSums& of_step, int64_t now_ns);
  void erase(Rows::iterator row);

  mutable Mutex mutex_;
  Rows rows_ GUARDED(mutex_);
  uint64_t opened_ GUARDED(mutex_) = 0;
  CameraSums sums_ GUARDED(mutex_);
};

}  // namespace sightline
