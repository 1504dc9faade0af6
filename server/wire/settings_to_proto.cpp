#include "server/wire/settings_to_proto.h"

namespace sightline {
namespace {

uint32_t whole(int value) {
  return static_cast<uint32_t>(value);
}

void set(const BoundSettings& settings, v1::Bound& out) {
  out.set_mode(settings.mode == BoundMode::kPaper ? v1::Bound::PAPER : v1::Bound::HORIZON);
  out.set_horizon_s(settings.horizon_s);
  out.set_max_horizon_s(settings.max_horizon_s);
  out.set_paper_n(settings.paper_n);
  out.set_towards_m(settings.towards_m);
}

void set(const SampleSettings& settings, v1::Sample& out) {
  out.set_resolution(whole(settings.resolution));
  out.set_points(whole(settings.points));
  out.set_jitter(settings.jitter_texels);
}

v1::Filter::Mode to_proto(FilterMode mode) {
  switch (mode) {
    case FilterMode::kNone:
      return v1::Filter::NONE;
    case FilterMode::kJoint:
      return v1::Filter::JOINT;
    case FilterMode::kPerTarget:
      return v1::Filter::PER_TARGET;
  }
  return v1::Filter::MODE_UNSPECIFIED;
}

void set(const FilterSettings& settings, v1::Filter& out) {
  out.set_mode(to_proto(settings.mode));
  out.set_alpha(settings.alpha);
  out.set_n(whole(settings.n));
  out.set_window_s(settings.window_s);
  out.set_on(settings.on);
  out.set_off(settings.off);
  out.set_min_occlusion_s(settings.min_occlusion_s);
  out.set_hold_s(settings.hold_s);
}

void set(const AggregateSettings& settings, v1::Aggregate& out) {
  out.set_volume(settings.volume == Volume::kPair ? v1::Aggregate::PAIR : v1::Aggregate::LATTICE);
  out.set_candidates(whole(settings.candidates));
  out.set_relative_bias(settings.relative_bias);
  out.set_needed_share(settings.needed_share);
  set(settings.filter, *out.mutable_filter());
}

void set(const BlendSettings& settings, v1::Blend& out) {
  out.set_distance(settings.distance);
  out.set_shelter(settings.shelter);
  out.set_full_depth_m(settings.full_depth_m);
  out.set_hidden(settings.hidden);
  out.set_route(settings.route);
  out.set_exposure(settings.exposure);
  out.set_tolerance(settings.tolerance);
  out.set_steadiness(settings.steadiness);
}

void set(const SurveySettings& settings, v1::Survey& out) {
  out.set_enabled(settings.enabled);
  out.set_memory_s(settings.memory_s);
  out.set_resolution(whole(settings.resolution));
  out.set_content(settings.content);
  out.set_hold(settings.hold);
}

void set(const CoherenceSettings& settings, v1::Coherence& out) {
  out.set_visibility(settings.visibility);
  out.set_view_angle(settings.view_angle);
  out.set_height(settings.height);
  out.set_distance(settings.distance);
  out.set_screen(settings.screen);
  out.set_responsiveness(settings.responsiveness);
}

v1::Move::Strategy to_proto(Strategy strategy) {
  switch (strategy) {
    case Strategy::kBasic:
      return v1::Move::BASIC;
    case Strategy::kRobust:
      return v1::Move::ROBUST;
    case Strategy::kBlend:
      return v1::Move::BLEND;
  }
  return v1::Move::STRATEGY_UNSPECIFIED;
}

void set(const MoveSettings& settings, v1::Move& out) {
  out.set_follow(settings.follow == Follow::kStay ? v1::Move::STAY : v1::Move::OFFSET);
  out.set_min_distance_m(settings.min_distance_m);
  out.set_max_distance_m(settings.max_distance_m);
  out.set_min_elevation_rad(settings.min_elevation_rad);
  out.set_max_elevation_rad(settings.max_elevation_rad);
  out.set_strategy(to_proto(settings.strategy));
  out.set_prediction_s(settings.prediction_s);
  out.set_predictive_power(settings.predictive_power);
  out.set_turn_share(settings.turn_share);
  out.set_turn_rad(settings.turn_rad);
  out.set_response_s(settings.response_s);
  set(settings.blend, *out.mutable_blend());
  set(settings.survey, *out.mutable_survey());
  set(settings.coherence, *out.mutable_coherence());
}

void set(const FramingSettings& settings, v1::Framing& out) {
  out.set_margin(settings.margin);
  out.set_dead_zone(settings.dead_zone);
  out.set_response_s(settings.response_s);
  if (!settings.zooms()) return;
  out.set_min_vertical_fov_rad(settings.min_vertical_fov_rad);
  out.set_max_vertical_fov_rad(settings.max_vertical_fov_rad);
}

}  // namespace

v1::Settings settings_to_proto(const StepSettings& settings) {
  v1::Settings out;
  set(settings.bound, *out.mutable_bound());
  set(settings.sample, *out.mutable_sample());
  set(settings.aggregate, *out.mutable_aggregate());
  set(settings.move, *out.mutable_move());
  set(settings.framing, *out.mutable_framing());
  return out;
}

v1::CameraLimits limits_to_proto(const CameraLimits& limits) {
  v1::CameraLimits out;
  out.set_max_speed_mps(limits.max_speed_mps);
  out.set_max_acceleration_mps2(limits.max_acceleration_mps2);
  out.set_max_angular_speed_radps(limits.max_angular_speed_radps);
  out.set_max_angular_acceleration_radps2(limits.max_angular_acceleration_radps2);
  out.set_body_radius_m(limits.body_radius_m);
  return out;
}

v1::Lens lens_to_proto(const Lens& lens, const Convention& convention) {
  v1::Lens out;
  out.set_field_of_view(fov_to_client(convention, lens.vertical_fov_rad, lens.aspect));
  out.set_aspect(lens.aspect);
  out.set_near_m(lens.near_m);
  return out;
}

}  // namespace sightline
