// How much of a target is seen: the mean of (points seen) / (points sampled) over a short time (paper 4: "the accumulation of this
// visibility information over different frames provides an improved estimate of the overall visibility of the target").
//
// Each sample of a step is uniform over the target's picture, so that its share is the pixels' on average, and the error left is the
// noise of few points. A step weighs by its points and by its age: 1 now, falling in a straight line to 0 at kShareWindowS. Such a
// triangle lags behind by a third of the window; a plain mean that lags as much has more noise. When the newest two steps together
// differ from those before them by more than chance explains (kShareSigmas standard deviations), something has changed, and those
// before are forgotten: the window is long where sight is steady and short behind a door that opens.
//
// Both were chosen by measurement, 8 points a target at 60 Hz over the generated scenes: without forgetting, the noise of fine
// occluders (a fence) prevails in a shorter window and the lag behind doors and pillars in a longer one. Against a window of
// 0.1 s without it, forgetting took the error from 0.026 to 0.021 behind doors and from 0.011 to 0.006 in the hall, and left the
// fence's as it was.
//
// In each step: begin_step, then add for every target. A value type; nothing is allocated unless the number of targets grows.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace sightline {

inline constexpr double kShareWindowS = 0.13;
inline constexpr double kShareSigmas = 2.0;
inline constexpr size_t kShareSteps = 32;  // of a window at most: at over 240 Hz it is the shorter for it

class ShareWindow {
 public:
  // `dt_s` >= 0 has passed since the step before. Targets are known by id: one that is there again keeps its window, wherever it
  // stands in the list; one that is not in the list is forgotten. No id twice.
  void begin_step(std::span<const uint64_t> target_ids, double dt_s);

  // Of `points` points of target i of the list `seen` are seen in this step. Once a step and target; not at all is 0 of 0.
  void add(size_t target, uint32_t seen, uint32_t points);

  // In [0, 1]; none when no point of the window counts.
  std::optional<double> share(size_t target) const;

  // After a cut, or when what was seen says nothing about now.
  void forget() { tracks_.clear(); }

 private:
  struct Step {
    double time_s = 0.0;
    uint32_t seen = 0, points = 0;
  };
  struct Track {
    uint64_t id = 0;
    size_t added = 0;  // steps ever; the newest is at (added - 1) % kShareSteps
    size_t kept = 0;   // the newest of them, in [0, kShareSteps]
    std::array<Step, kShareSteps> ring{};

    const Step& newest(size_t back) const { return ring[(added - 1 - back) % kShareSteps]; }
  };
  bool has_changed(const Track& track) const;
  void drop_old(Track& track) const;

  double time_s_ = 0.0;
  std::vector<Track> tracks_;  // in the order of the list
};

}  // namespace sightline
