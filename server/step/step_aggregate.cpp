// The third stage: what every candidate sees, now, over the last steps, and where the targets are going (paper 3.3, 5).
#include <algorithm>

#include "server/step/step_work.h"

namespace sightline {
namespace {

bool filters(const StepWork& w) {
  return w.input.settings.aggregate.filter.mode != FilterMode::kNone;
}

// With a filter the pairs' maps are looked up at the lattice's cells, by the inverse of the volumes' maps: only a place in
// the world can have a past.
void list_candidates(StepWork& w) {
  const AggregateSettings& settings = w.input.settings.aggregate;
  CandidateSet& candidates = w.memory.candidates;
  Lattice& lattice = w.memory.lattice;
  // What is remembered by cell: sights, and of the way to the goal.
  if (filters(w) || expects_hidden(w))
    lattice.cover(w.memory.bound, settings.candidates);
  else
    lattice.lay(w.memory.bound, settings.candidates);
  w.on_lattice = !w.pair || filters(w);
  if (w.on_lattice)
    candidates.position_m.set_runs(lattice.spacing_m(), lattice.runs(), lattice.size());
  else
    compose_chain(w.memory.chain, w.memory.maps, w.memory.bound, settings.relative_bias, candidates);
}

// The place itself when the bound holds it, else the nearest place of the bound.
glm::dvec3 nearest_in_bound(const Bound& bound, const glm::dvec3& place) {
  const glm::dvec3 out = place - bound.center_m;
  const double distance = glm::length(out), reach = bound.radius_m * (1 - 1e-9);
  return distance <= reach ? place : bound.center_m + out * (reach / distance);
}

uint32_t seen_from_own_place(const StepWork& w) {
  uint32_t visible = 0;
  for (size_t i = 0; i < w.input.targets.size(); ++i) {
    const OwnSight sight = own_sight(w, i, w.memory.camera.pose.position_m);
    if (is_enough(sight.seen, sight.points, w.input.settings.aggregate.visibility_threshold)) visible |= 1u << i;
  }
  return visible;
}

// Two places that no grid holds: where the camera is, and where it wants to be. Without them a camera at rest would step
// between grid points.
void add_own_and_desired_place(StepWork& w) {
  PlaceList& position_m = w.memory.candidates.position_m;
  w.own_candidate = position_m.size();
  position_m.push_back(w.memory.camera.pose.position_m);
  if (w.steered != 0) position_m.push_back(nearest_in_bound(w.memory.bound, desired_place(w)));
}

// What all candidates see; of the pair volumes' the chain has told.
void look_now(StepWork& w) {
  CandidateSet& candidates = w.memory.candidates;
  Composer& composer = w.memory.composer;
  const double bias = w.input.settings.aggregate.relative_bias;
  const SampledPoints sampled = as_input(w, w.memory.now);
  std::vector<uint32_t>& visible = w.on_lattice ? candidates.visible_targets : w.memory.off_grid_visible;
  composer.set_positions(w.on_lattice ? candidates.position_m.view()
                                      : PlaceView(candidates.position_m.view().singles_m().subspan(w.own_candidate)));
  if (expects_hidden(w) && w.on_lattice)
    composer.visibility_and_hidden(sampled, bias, hidden_weights(w, 1 - weight_ahead(w)), visible,
                                   w.memory.goal.hidden_by);
  else
    composer.visibility(sampled, bias, visible);
  if (!w.on_lattice) {
    composer.set_positions(candidates.position_m);
    candidates.visible_targets.insert(candidates.visible_targets.end(), visible.begin(), visible.end());
    if (expects_hidden(w))
      composer.add_hidden(sampled, bias, hidden_weights(w, 1 - weight_ahead(w)), w.memory.goal.hidden_by);
  }
  candidates.visible_targets[w.own_candidate] = seen_from_own_place(w);
}

// Cells of the lattice keep what they saw; the two other places take over the past of the cell that they are nearest to.
void filter(StepWork& w) {
  CandidateSet& candidates = w.memory.candidates;
  // Steps are counted only while a filter is on: what was seen before it went off must not pass for the newest.
  if (!filters(w)) w.memory.volume = {};
  if (!filters(w) || w.move_s <= 0) return;
  const size_t cells = w.memory.lattice.size(), places = candidates.size() - cells;
  TemporalVolume& volume = w.memory.volume;
  volume.begin_step(w.memory.lattice, 2, w.memory.target_ids, w.input.settings.aggregate.filter, w.move_s);
  volume.push(w.memory.lattice, std::span(candidates.visible_targets).first(cells));
  w.memory.slots = w.memory.lattice.addresses();
  for (size_t k = 0; k < places; ++k) {
    volume.push_place(k, w.memory.lattice, candidates.position_m[cells + k],
                      candidates.visible_targets[cells + k]);
    w.memory.slots.push_back(volume.place_slot(k));
  }
  volume.filter(w.memory.slots, candidates.visible_targets, w.steered, w.memory.filtered);
  candidates.filtered_targets.swap(w.memory.filtered.visible_targets);
}

void look_ahead(StepWork& w) {
  CandidateSet& candidates = w.memory.candidates;
  if (w.memory.ahead_s <= 0) return;
  const double bias = w.input.settings.aggregate.relative_bias;
  const SampledPoints sampled = as_input(w, w.memory.ahead);
  if (expects_hidden(w) && weight_ahead(w) > 0)
    w.memory.composer.visibility_and_hidden(sampled, bias, hidden_weights(w, weight_foretold(w)),
                                            candidates.ahead_targets, w.memory.goal.hidden_by);
  else
    w.memory.composer.visibility(sampled, bias, candidates.ahead_targets);
}

}  // namespace

SampledPoints as_input(const StepWork& w, const Sampled& sampled) {
  return {w.memory.maps, sampled.maps_of_point, sampled.points_of_target,
          w.input.settings.aggregate.visibility_threshold};
}

double falls_short_m(const StepWork& w, uint32_t sight, const glm::dvec3& place_m) {
  const DepthMap& map = w.memory.maps[w.memory.now.first_sight + sight];
  const double slack = 1.0 + w.input.settings.aggregate.relative_bias;
  return glm::distance(place_m, w.memory.now.sights_m[sight]) - map.distance_at(0, 0) * slack;
}

OwnSight own_sight(const StepWork& w, size_t target, const glm::dvec3& place_m) {
  const MapRange& sights = w.memory.now.sights_of_target[target];
  OwnSight own{.points = sights.count};
  for (uint32_t k = sights.first; k < sights.first + sights.count; ++k) {
    const bool visible = falls_short_m(w, k, place_m) <= 0;
    own.seen += visible;
    if (!visible && own.occluder == kNoOccluder)
      own.occluder = w.memory.maps[w.memory.now.first_sight + k].occluder_at(0, 0);
  }
  return own;
}

void aggregate(StepWork& w) {
  w.memory.candidates.clear();
  w.result.volume = w.pair ? Volume::kPair : Volume::kLattice;
  if (w.input.targets.empty()) {
    count_sights(w.memory.candidates, 0, 0, w.memory.counts);
    return;
  }
  learn_survey(w);
  list_candidates(w);
  add_own_and_desired_place(w);
  begin_hidden(w);
  look_now(w);
  filter(w);
  look_ahead(w);
  expect_hidden(w);
  if (w.input.settings.move.strategy != Strategy::kBasic) list_places(w.memory.candidates.position_m, w.memory.place_m);
  count_sights(w.memory.candidates, w.steered, w.input.targets.size(), w.memory.counts);
}

}  // namespace sightline
