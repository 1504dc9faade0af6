// How far a step's maps agree with rays to its candidates.
#pragma once

#include <vector>

#include "server/step/step.h"
#include "tests/bench/speed/peers.h"

namespace sightline::bench {

// Means over frames. A frame counts where it has something to compare.
class MapAgreement {
 public:
  // `peer` must outlive it.
  explicit MapAgreement(RayPeer& peer) : peer_(peer) {}

  // Adds the step just taken. Bit t of seen[k] says whether the peer's ray from from[t] reaches candidate k, at
  // place_m[k].
  void add(const StepDump& dump, const std::vector<SeenFrom>& from, const std::vector<glm::dvec3>& place_m,
           const std::vector<uint32_t>& seen);

  // The share of the candidates x targets on which both agree. Candidates that lie on a surface do not count. -1:
  // nothing was compared.
  double share() const { return plain_.mean(); }
  // The same where every candidate is moved onto the map's nearest ray, at its distance. There a map has no error of
  // resolution. Targets with several maps do not count.
  double share_on_rays() const { return on_rays_.mean(); }

 private:
  struct Mean {
    double sum = 0;
    size_t frames = 0;
    void add(double share);  // below 0: the frame does not count
    double mean() const { return frames == 0 ? -1 : sum / static_cast<double>(frames); }
  };

  // Finds which rays answer the same when they end 1 cm before or beyond the place. A place on a surface, as a layer of
  // the lattice is in level ground, is neither hidden nor visible: rounding decides.
  void find_clear(const SeenFrom& from, const std::vector<glm::dvec3>& place_m, size_t t);
  double on_rays(const StepDump& dump, const std::vector<SeenFrom>& from, const std::vector<glm::dvec3>& place_m);

  RayPeer& peer_;
  std::vector<glm::dvec3> moved_m_;
  std::vector<uint32_t> clear_, before_, beyond_, on_ray_;
  Mean plain_, on_rays_;
};

}  // namespace sightline::bench
