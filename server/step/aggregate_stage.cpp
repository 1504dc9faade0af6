// The aggregate stage: the visibility from every candidate, now, over the last steps, and for the predicted targets
// (paper 3.3, 5).
#include <algorithm>

#include "server/move/framing.h"
#include "server/move/sight_weight.h"
#include "server/step/stages.h"

namespace sightline {
namespace {

// How much a new estimate of a slice counts beside the former ones.
constexpr double kNewShare = 0.35;

class Aggregation {
 public:
  Aggregation(const AggregateInput& in, CandidateMemory& memory, AggregateScratch& scratch, CandidateSights& sights)
      : step_(in.step),
        bound_(in.bound),
        taken_(in.taken),
        plan_(in.taken.plan),
        settings_(in.taken.settings),
        desired_m_(in.desired_m),
        memory_(memory),
        scratch_(scratch),
        sights_(sights),
        candidates_(sights.candidates),
        weighs_hidden_(weighs_hidden(in.step.input)) {}

  void list_candidates();
  void add_own_and_desired_position();
  void list_own_texels();
  void fit_cells();
  void look_now();
  void filter();
  void filter_pairs();
  void look_ahead();
  void add_up_hidden();
  void renew_slices();

 private:
  bool filters() const { return settings_.filter.mode != FilterMode::kNone; }
  void take_from_moved_cells(auto& by_candidate) const;
  void mark_what_passes();
  HiddenWeights hidden_weights(double weight) const {
    return {scratch_.passes, step_.targets.sight_weights, weight};
  }
  uint32_t seen_from_own_position() const;
  void smooth_what_passes();
  void find_outside(std::span<const glm::dvec3> aim_m);

  const StepContext& step_;
  const Bound& bound_;
  const TakenMaps& taken_;
  const SamplePlan& plan_;
  const AggregateSettings& settings_;
  const glm::dvec3 desired_m_;
  CandidateMemory& memory_;
  AggregateScratch& scratch_;
  CandidateSights& sights_;
  CandidateSet& candidates_;
  const bool weighs_hidden_;
};

// `cover` gives cells addresses, which are needed where data is stored by cell: visibility for the filter, or clearance and smoothed
// occlusion.
void Aggregation::list_candidates() {
  sights_.on_lattice = !plan_.pair.used;
  sights_.texels.clear();
  if (plan_.pair.used)
    return compose_chain(plan_.chain, taken_.maps, bound_, settings_.relative_bias, candidates_, sights_.texels);
  Lattice& lattice = memory_.lattice;
  if (filters() || weighs_hidden_)
    lattice.cover(bound_, settings_.candidates);
  else
    lattice.lay(bound_, settings_.candidates);
  candidates_.position_m.set_runs(lattice.spacing_m(), lattice.runs(), lattice.size());
}

// Adds two candidates off the grid: the camera's own position and the desired one. Without them a camera at rest would
// move between grid points.
void Aggregation::add_own_and_desired_position() {
  sights_.own_candidate = candidates_.position_m.size();
  candidates_.position_m.push_back(step_.camera.pose.position_m);
  if (step_.targets.steered != 0) candidates_.position_m.push_back(nearest_in_bound_m(bound_, desired_m_));
  if (!sights_.on_lattice) list_own_texels();
}

void Aggregation::list_own_texels() {
  const glm::dvec2 jitter = taken_.maps.front().view.jitter;
  for (size_t i = sights_.own_candidate; i < candidates_.position_m.size(); ++i) {
    const auto texels = nearest_texels(plan_.chain.links.front().volume, candidates_.position_m[i], jitter);
    sights_.texels.push_back(texels.value_or(glm::ivec3(-2 - 2 * static_cast<int>(i - sights_.own_candidate), 0, 0)));
  }
}

// Moves cells to where the body fits. Their places follow the candidates for the look-ups.
void Aggregation::fit_cells() {
  list_places(candidates_.position_m, sights_.position_m);
  const std::span<const float> clearance_m =
      scratch_.clearance_cache.measure(step_.input.scene, memory_.lattice, bound_, sights_.position_m, sights_.on_lattice, route_radius_m(step_));
  sights_.clearance_m.assign(clearance_m.begin(), clearance_m.end());
  scratch_.places = candidates_.position_m;
  for (const uint32_t cell : scratch_.clearance_cache.moved()) scratch_.places.push_back(sights_.position_m[cell]);
}

// Gives each moved cell what was found for its place, and removes the places' own entries.
void Aggregation::take_from_moved_cells(auto& by_candidate) const {
  const std::span<const uint32_t> moved = scratch_.clearance_cache.moved();
  const size_t candidates = by_candidate.size() - moved.size();
  for (size_t k = 0; k < moved.size(); ++k) by_candidate[moved[k]] = by_candidate[candidates + k];
  by_candidate.resize(candidates);
}

// Marks the moving occluders, which may soon be gone. Targets are not marked, because they may hide each other for long
// while they walk together.
void Aggregation::mark_what_passes() {
  scratch_.passes.assign(step_.input.scene.instances().size(), 0);
  for (const uint32_t slot : step_.input.scene.moving_slots()) scratch_.passes[slot] = 1;
  for (const uint64_t id : step_.targets.ids) scratch_.passes[*step_.input.scene.slot_of(id)] = 0;
  for (const std::vector<TargetPiece>& pieces : step_.targets.pieces)
    for (const TargetPiece& piece : pieces) scratch_.passes[piece.slot] = 0;
}

uint32_t Aggregation::seen_from_own_position() const {
  uint32_t visible = 0;
  for (size_t i = 0; i < step_.target_count(); ++i) {
    const OwnSight sight = own_sight(taken_, i, step_.camera.pose.position_m);
    if (is_enough(sight.seen, sight.points, settings_.visibility_threshold)) visible |= 1u << i;
  }
  return visible;
}

// Finds the targets that each candidate sees now. For candidates of pair volumes the chain has found that already.
void Aggregation::look_now() {
  Composer& composer = scratch_.composer;
  const double bias = settings_.relative_bias;
  const SampledPoints sampled = taken_.of(plan_.now);
  std::vector<uint32_t>& visible = sights_.on_lattice ? candidates_.visible_targets : scratch_.off_grid_visible;
  if (weighs_hidden_) {
    composer.set_positions(scratch_.places);
    scratch_.hidden_by.reset(scratch_.places.size());
    mark_what_passes();
    composer.visibility_and_hidden(sampled, bias, hidden_weights(1.0), visible, scratch_.hidden_by);
    take_from_moved_cells(visible);
    take_from_moved_cells(scratch_.hidden_by.by_staying);
    take_from_moved_cells(scratch_.hidden_by.by_passing);
  } else {
    composer.set_positions(sights_.on_lattice
                               ? candidates_.position_m.view()
                               : PlaceView(candidates_.position_m.view().singles_m().subspan(sights_.own_candidate)));
    composer.visibility(sampled, bias, visible);
  }
  if (!sights_.on_lattice) {
    composer.set_positions(candidates_.position_m);
    candidates_.visible_targets.insert(candidates_.visible_targets.end(), visible.begin(), visible.end());
  }
  candidates_.visible_targets[sights_.own_candidate] = seen_from_own_position();
}

// The past of a pair volume's candidates is looked up in the volumes of the last steps.
void Aggregation::filter_pairs() {
  memory_.volume.forget();  // its steps would pass for recent ones later
  if (step_.move_s <= 0) return;
  const std::span<const uint64_t> ids = step_.targets.ids;
  memory_.pairs.push(plan_.chain, taken_.maps.first(ids.size()), ids, settings_.relative_bias, settings_.filter.n);
  memory_.pairs.filter(candidates_.position_m.view().singles_m(), candidates_.visible_targets, ids, step_.targets.steered, settings_.filter,
                       candidates_.filtered_targets);
}

// Lattice cells keep their history. The two positions off the lattice take over the history of the nearest cell.
void Aggregation::filter() {
  // The histories count steps only while a filter is on, so old entries must not pass for recent ones when it is
  // switched on again.
  if (!filters()) memory_.volume = {};
  if (settings_.filter.mode != FilterMode::kJoint || !plan_.pair.asked) memory_.pairs.clear();
  if (filters() && !sights_.on_lattice) return filter_pairs();
  if (!filters() || step_.move_s <= 0) return;
  if (settings_.filter.mode == FilterMode::kJoint && plan_.pair.asked) memory_.pairs.push_none(settings_.filter.n);  // it took none
  const size_t cells = memory_.lattice.size(), others = candidates_.size() - cells;
  TemporalVolume& volume = memory_.volume;
  volume.begin_step(memory_.lattice, 2, step_.targets.ids, settings_.filter, step_.move_s);
  volume.push(memory_.lattice, std::span(candidates_.visible_targets).first(cells));
  scratch_.slots = memory_.lattice.addresses();
  for (size_t k = 0; k < others; ++k) {
    volume.push_place(k, memory_.lattice, candidates_.position_m[cells + k], candidates_.visible_targets[cells + k]);
    scratch_.slots.push_back(volume.place_slot(k));
  }
  volume.filter(scratch_.slots, candidates_.visible_targets, step_.targets.steered, candidates_.filtered_targets);
}

void Aggregation::look_ahead() {
  if (plan_.ahead_s > 0 && !weighs_hidden_)  // a flight plan knows more (renew_slices)
    scratch_.composer.visibility(taken_.of(plan_.ahead), settings_.relative_bias, candidates_.ahead_targets);
}

// The hidden share of the targets from each candidate now.
void Aggregation::add_up_hidden() {
  if (!weighs_hidden_) return;
  smooth_what_passes();
  const std::vector<double>&by_staying = scratch_.hidden_by.by_staying, &by_passing = scratch_.hidden_by.by_passing;
  sights_.hidden.resize(by_staying.size());
  for (size_t i = 0; i < by_staying.size(); ++i)
    sights_.hidden[i] = std::clamp(by_staying[i] + by_passing[i], 0.0, 1.0);
}

// The share of the targets that pictures from each cell cannot hold, as far as the targets have come apart.
void Aggregation::find_outside(std::span<const glm::dvec3> aim_m) {
  double radii_m = 0, weighing = 0;
  for (size_t i = 0; i < step_.target_count(); ++i)
    if (step_.targets.sight_weights[i] > 0) radii_m += step_.targets.tracked_targets[i].radius_m, weighing += 1;
  const bool stays = step_.input.settings.move.follow == Follow::kStay;
  const double radius_m = 1e-3 + radii_m / std::max(weighing, 1.0);
  const auto apart_by = stays ? 0.0f : static_cast<float>(apart(aim_m, step_.targets.sight_weights, radius_m));
  if (apart_by == 0) return scratch_.outside.assign(memory_.lattice.size(), 0.0f);
  scratch_.picture_fit.set_places(std::span(sights_.position_m).first(memory_.lattice.size()));
  scratch_.picture_fit.outside_share(aim_m, step_.targets.sight_weights, widest(step_.lens, step_.input.settings.framing), scratch_.outside);
  const double several = std::max(1.0, effective_count(step_.targets.sight_weights) / 2);
  for (float& share : scratch_.outside) share *= apart_by / static_cast<float>(several * several);
}

// What a picture from each cell is expected to lack at the slices that are due.
void Aggregation::renew_slices() {
  HiddenAhead& ahead = memory_.ahead;
  if (!weighs_hidden_) return ahead.restart();
  const uint64_t targets = hash_of(step_.targets, step_.targets.steered);
  if (targets != memory_.ahead_targets) ahead.restart();
  memory_.ahead_targets = targets;
  ahead.advance(memory_.lattice, step_.move_s);
  const size_t cells = memory_.lattice.size();
  const double count = effective_count(step_.targets.sight_weights);
  scratch_.shares.resize(cells), scratch_.outside.resize(cells);
  for (const SampledSlice& slice : plan_.slices) {
    HiddenShares& hidden = scratch_.hidden_by;
    hidden.reset(scratch_.places.size());
    scratch_.composer.add_hidden(taken_.of(slice.sampled), settings_.relative_bias, hidden_weights(1.0), hidden);
    take_from_moved_cells(hidden.by_staying);
    take_from_moved_cells(hidden.by_passing);
    find_outside(slice.aim_m);
    // Before renewals are averaged, since a target is rarely whole where it is often hidden in part.
    for (size_t i = 0; i < cells; ++i) {
      const double share = std::max(hidden.by_staying[i] + hidden.by_passing[i], static_cast<double>(scratch_.outside[i]));
      scratch_.shares[i] = static_cast<float>(picture_loss(std::min(share, 1.0), count));
    }
    ahead.renew(slice.due.slice, memory_.lattice, scratch_.shares, kNewShare);
  }
}

// Low-passes the share that moving occluders hide, so that short occlusions count little.
void Aggregation::smooth_what_passes() {
  const FilterSettings& filter = settings_.filter;
  memory_.smoother.update(memory_.lattice, sights_.on_lattice, step_.move_s,
                          filter.mode == FilterMode::kPerTarget ? filter.min_occlusion_s : 0.0,
                          scratch_.hidden_by.by_passing);
}

}  // namespace

glm::dvec3 nearest_in_bound_m(const Bound& bound, const glm::dvec3& position_m) {
  const glm::dvec3 out_m = position_m - bound.center_m;
  const double distance_m = glm::length(out_m), reach_m = bound.radius_m * (1 - 1e-9);
  return distance_m <= reach_m ? position_m : bound.center_m + out_m * (reach_m / distance_m);
}

void aggregate(const AggregateInput& in, CandidateMemory& memory, AggregateScratch& scratch, CandidateSights& sights) {
  sights.candidates.clear();
  const StepContext& step = in.step;
  if (step.input.targets.empty()) {
    memory.ahead.restart();
    memory.pairs.clear();
    return count_sights(sights.candidates, 0, 0, sights.counts);
  }
  Aggregation aggregation(in, memory, scratch, sights);
  aggregation.list_candidates();
  aggregation.add_own_and_desired_position();
  if (weighs_hidden(step.input)) aggregation.fit_cells();
  aggregation.look_now();
  aggregation.filter();
  aggregation.look_ahead();
  aggregation.add_up_hidden();
  aggregation.renew_slices();
  if (step.input.settings.move.strategy == Strategy::kRobust)
    list_places(sights.candidates.position_m, sights.position_m);
  count_sights(sights.candidates, step.targets.steered, step.target_count(), sights.counts);
}

}  // namespace sightline
