// What each cell of the flight plan (move/flight_plan.h) costs at each slice: what pictures from there are expected to
// lack of the targets and of the shot, the distance from the desired position, and the limits of places. Costs are in
// metres, as the weights are (CostWeights).
#pragma once

#include <optional>
#include <vector>

#include "server/base/inline_vector.h"
#include "server/step/stages.h"

namespace sightline {

// How much the time after a plan counts (FlightSettings).
inline constexpr double kAfterwards = 0.3;

// Used for one decision; `in`, `flight` and `scratch` must outlive it. Not thread-safe.
class PlanPricer {
 public:
  // `scratch` is memory that is used again.
  PlanPricer(const MoveInput& in, const FlightSettings& flight, MoveScratch& scratch);

  // Sets the costs of all slices. The scratch's planner must have been laid over the candidates.
  void price();
  // The cost of a course on which no target is seen; 0 where sight does not count.
  double blind_cost() const { return occlusion_ * (1 + kAfterwards); }
  // True if a picture that is taken from a place after a time departs from the client's shot by no more than the free
  // bands, as in ShotReport.
  bool is_in_free_bands(const glm::dvec3& place_m, double ahead_s) const;

 private:
  void price_hidden(size_t slice);
  void list_open_doors();
  void find_hidden_by_doors(size_t slice);
  float guessed_share(size_t candidate, size_t slice) const;
  double fastest_target_mps() const;
  void move_limits(double time_s);
  void price_limits();

  const MoveInput& in_;
  FlightPlanner& planner_;
  const FlightSettings& flight_;
  std::vector<float>& outside_;  // by cell: the cost of being outside the limits
  BehindDoors& doors_;
  InlineVector<TrackedTarget, kMaxTargets> targets_;  // where they are when these limits hold
  const CostWeights& weights_;
  const HiddenAhead& ahead_;
  const Lattice& lattice_;
  const glm::dvec3 group_mps_;
  const double count_;          // of targets, see effective_count
  bool guesses_ahead_ = false;  // false behind a fast target, see guessed_share
  double occlusion_ = 0, tolerance_ = 0, distance_ = 0;
  // The offset from the subjects' middle to the camera that pictures are compared with. Empty: they are not.
  std::optional<glm::dvec3> asked_m_;
  double shot_ = 0;
};

}  // namespace sightline
