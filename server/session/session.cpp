#include "server/session/session.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "server/base/check.h"
#include "server/session/answer_check.h"
#include "server/step/quality_level.h"

namespace sightline {
namespace {

StageClock or_no_clock(StageClock clock) {
  return clock ? std::move(clock) : StageClock([] { return int64_t{0}; });
}

tl::unexpected<Error> below(const std::string& prefix, Error error) {
  error.field = prefix + error.field;
  return tl::unexpected(std::move(error));
}

// The widest of the lens, its zoom and the lens range of the shot. The body must contain the corners of its near plane.
Lens lens_for_body(const Lens& lens, const FramingSettings& framing, const AskedShot& shot) {
  Lens wide = lens;
  if (zooms(framing)) wide.vertical_fov_rad = std::max(lens.vertical_fov_rad, framing.max_vertical_fov_rad);
  wide.vertical_fov_rad = std::max(wide.vertical_fov_rad, shot.max_vertical_fov_rad);
  return wide;
}

Status check_options(const SessionOptions& options) {
  if (Status ok = validate(options.convention); !ok) return below("open.", ok.error());
  if (Status ok = check_pose(options.camera, "open.camera"); !ok) return ok;
  if (Status ok = check_lens(options.lens, "open.lens"); !ok) return ok;
  if (Status ok = validate(options.settings); !ok) return below("open.", ok.error());
  if (Status ok = validate(options.limits, lens_for_body(options.lens, options.settings.framing, options.shot)); !ok)
    return below("open.limits.", ok.error());
  if (options.label.size() > kMaxLabelBytes)
    return invalid("open.label", "at most 64 bytes, got " + std::to_string(options.label.size()));
  return {};
}

// "add[7].id" -> "open.instances[2].id" when the scene file has five instances. Errors in those name open.scene.
Error in_open_request(Error error, size_t scene_instances) {
  if (!error.field.starts_with("add[")) return {error.code, "open.instances", std::move(error.message)};
  const size_t index = std::stoull(error.field.substr(4));
  if (index < scene_instances) return {error.code, "open.scene", error.field + ": " + error.message};
  const std::string named = client_field(error.field);
  return {error.code, indexed("open.instances", index - scene_instances) + named.substr(named.find(']') + 1),
          std::move(error.message)};
}

// The greatest distance between a position that was sent and the same position after a client kept it in single
// precision. It is four times the rounding error of the largest coordinate.
double rounding_m(const Convention& convention, const glm::dvec3& position_m) {
  const glm::dvec3 client_m = glm::abs(position_m + convention.origin_m);
  return 0x1p-22 * std::max({client_m.x, client_m.y, client_m.z});
}

// The first required target with a weight, else the first target with a weight; null: there is none.
const Target* relative_target(const std::vector<Target>& targets) {
  const Target* first = nullptr;
  for (const Target& target : targets) {
    if (!(target.weight > 0)) continue;
    if (target.required) return &target;
    if (!first) first = &target;
  }
  return first;
}

}  // namespace

Session::Session(SessionOptions options, std::unique_ptr<Sampler> sampler, StageClock clock)
    : options_(std::move(options)), sampler_(std::move(sampler)), clock_(or_no_clock(std::move(clock))) {}

Result<std::unique_ptr<Session>> Session::open(SessionOptions options, std::unique_ptr<Sampler> sampler,
                                               StageClock clock) {
  if (Status ok = check_options(options); !ok) return tl::unexpected(ok.error());
  std::unique_ptr<Session> session(new Session(std::move(options), std::move(sampler), std::move(clock)));
  if (Status ok = session->add_first_instances(); !ok) return tl::unexpected(ok.error());
  const SceneDelta nothing;
  const IdsAfter ids(session->mirror_, nothing);
  if (Status ok = check_targets(session->options_.targets, ids, "open.targets"); !ok) return tl::unexpected(ok.error());
  session->take_extents();
  if (session->sampler_) session->sampler_->prepare(session->mirror_);  // a session that never steps needs none
  session->stepper_.place_camera(session->options_.camera, glm::dvec3(0.0));
  return session;
}

// Looks up the tables of the targets' shapes. Needed again whenever targets, instances or settings may have changed;
// some settings need no tables.
void Session::take_extents() {
  extents_.clear();
  extent_views_.clear();
  part_extent_views_.clear();
  if (!options_.extents || options_.settings.sample.points == 0) return;
  for (const Target& target : options_.targets) {
    extent_views_.push_back(extent_of(*mirror_.find(target.instance_id)));
    for (const uint64_t id : target.part_ids) {
      const Instance* part = mirror_.find(id);
      part_extent_views_.push_back(part ? extent_of(*part) : nullptr);
    }
  }
}

const ExtentTable* Session::extent_of(const Instance& instance) {
  return extents_.emplace_back(options_.extents->get(instance.geometry)).get();
}

bool Session::lacks_table(uint64_t instance_id) const {
  const Instance* instance = mirror_.find(instance_id);
  return options_.extents && instance && instance->geometry && !options_.extents->has(*instance->geometry);
}

Status Session::add_first_instances() {
  SceneDelta delta;
  delta.asset_ids_allowed = true;
  delta.add = std::move(options_.instances);
  options_.instances.clear();
  if (Status ok = mirror_.apply(delta, {}); !ok)
    return tl::unexpected(in_open_request(ok.error(), options_.scene_instances));
  const auto assets = std::exchange(options_.mesh_assets, {});
  hold(assets);
  return {};
}

size_t Session::triangle_count() const {
  size_t count = 0;
  for (const Instance& instance : mirror_.instances())
    if (instance.geometry) count += instance.geometry->triangle_count();
  return count;
}

Status Session::apply(const TickInput& tick) {
  const int64_t start_ns = clock_();
  const IdsAfter ids(mirror_, tick.delta);
  if (Status ok = check(tick, ids); !ok) return ok;
  fill_update(tick, ids);
  if (Status ok = mirror_.apply(tick.delta, update_); !ok)
    return fail(ok.error().code, "tick." + client_field(ok.error().field), ok.error().message);
  commit(tick);  // cannot fail: the tick is whole
  pending_scene_ns_ += clock_() - start_ns;
  return {};
}

Status Session::check(const TickInput& tick, const IdsAfter& ids) const {
  if (Status ok = check_clock(tick); !ok) return ok;
  if (Status ok = check_camera(tick); !ok) return ok;
  for (size_t i = 0; i < tick.transforms.velocities_mps.size(); ++i)
    if (Status ok = check_speed(tick.transforms.velocities_mps[i], indexed("tick.transforms.velocities", 3 * i)); !ok)
      return ok;
  for (size_t i = 0; i < tick.transforms.angular_velocities_radps.size(); ++i)
    if (Status ok = check_turn(tick.transforms.angular_velocities_radps[i],
                               indexed("tick.transforms.angular_velocities", 3 * i));
        !ok)
      return ok;
  if (tick.targets) return check_targets(*tick.targets, ids, "tick.targets.targets");
  for (size_t i = 0; i < tick.delta.remove.size(); ++i) {
    const uint64_t id = tick.delta.remove[i];
    const auto is_it = [id](const Target& target) { return target.instance_id == id; };
    if (!ids.contains(id) && std::any_of(options_.targets.begin(), options_.targets.end(), is_it))
      return fail(ErrorCode::kFailedPrecondition, indexed("tick.delta.removed_ids", i),
                  "is a target; replace the target list in the same tick");
  }
  return {};
}

Status Session::check_clock(const TickInput& tick) const {
  if (ticked_ && tick.sequence <= sequence_)
    return invalid("tick.sequence",
                   "must increase, got " + std::to_string(tick.sequence) + " after " + std::to_string(sequence_));
  if (!(std::abs(tick.time_s) <= kFarthestTimeS))
    return check_range("tick.time_s", tick.time_s, -kFarthestTimeS, kFarthestTimeS);
  if (ticked_ && tick.time_s < time_s_)
    return invalid("tick.time_s",
                   "must not go back, got " + std::to_string(tick.time_s) + " after " + std::to_string(time_s_));
  return tick.dt_s ? check_range("tick.dt_s", *tick.dt_s, 0.0, kFarthestTimeS) : Status{};
}

Status Session::check_camera(const TickInput& tick) const {
  if (tick.observed_camera) {
    if (Status ok = check_pose(tick.observed_camera->pose, "tick.observed_camera.pose"); !ok) return ok;
    if (Status ok = check_speed(tick.observed_camera->velocity_mps, "tick.observed_camera.velocity"); !ok) return ok;
    if (Status ok = check_turn(tick.observed_camera->angular_velocity_radps, "tick.observed_camera.angular_velocity");
        !ok)
      return ok;
  }
  return check_terms(tick);
}

// Checks lens, shot, settings and limits by themselves and in combination with the session's present values.
Status Session::check_terms(const TickInput& tick) const {
  if (!tick.lens && !tick.settings && !tick.limits && !tick.shot) return {};
  const Lens& lens = tick.lens ? *tick.lens : options_.lens;
  const StepSettings& settings = tick.settings ? *tick.settings : options_.settings;
  if (Status ok = check_lens(lens, "tick.lens"); !ok) return ok;
  if (Status ok = validate(settings); !ok) return below("tick.", ok.error());
  const Status ok = validate(tick.limits ? *tick.limits : options_.limits,
                             lens_for_body(lens, settings.framing, tick.shot ? *tick.shot : options_.shot));
  if (ok) return {};
  if (tick.limits) return below("tick.limits.", ok.error());
  return invalid(tick.lens       ? "tick.lens"
                 : tick.settings ? "tick.settings.max_vertical_fov_rad"
                                 : "tick.shot.max_field_of_view",
                 "does not go with the session's limits." + ok.error().field + ": " + ok.error().message);
}

double Session::step_length_s(const TickInput& tick) const {
  const double dt_s = tick.dt_s ? *tick.dt_s : ticked_ ? tick.time_s - time_s_ : 0.0;
  if (dt_s < kShortestStepS) return 0.0;
  return std::min(dt_s, kLongestStepS);
}

// An instance that stays must not seem to move, because coordinates round otherwise in a shifted world.
void Session::stay_if_rounded(const Instance& before, const glm::dvec3& world_shift_m, glm::dvec3& position_m) const {
  const double rounding_m = 0x1p-48 * (glm::length(options_.convention.origin_m) + glm::length(world_shift_m) +
                                       glm::length(position_m));
  if (glm::distance(position_m, before.pose.position_m) <= rounding_m) position_m = before.pose.position_m;
}

// Fills update_ for the mirror: the tick's transforms, completed by kept rotations, derived velocities and corrections
// of held and noisy positions.
void Session::fill_update(const TickInput& tick, const IdsAfter& ids) {
  const TransformUpdate& sent = tick.transforms;
  const bool derives = sent.velocities_mps.empty(), derives_turns = sent.angular_velocities_radps.empty();
  update_.ids = sent.ids;
  update_.poses = sent.poses;
  update_.velocities_mps.clear(), update_.angular_velocities_radps.clear(), update_.corrections_m.clear();
  new_tracks_.clear();
  const auto counts = [&](size_t numbers) { return numbers == sent.ids.size(); };
  if (!counts(sent.poses.size()) || !(derives || counts(sent.velocities_mps.size())) ||
      !(derives_turns || counts(sent.angular_velocities_radps.size()))) {
    update_.velocities_mps = sent.velocities_mps, update_.angular_velocities_radps = sent.angular_velocities_radps;
    return;  // the mirror returns the error
  }
  const double dt_s = step_length_s(tick);
  for (size_t i = 0; i < sent.ids.size(); ++i) {
    const Instance* before = ids.staying(sent.ids[i]);
    if (tick.keeps_rotations) {
      const NewInstance* added = ids.added(sent.ids[i]);
      update_.poses[i].rotation = added ? added->pose.rotation : before ? before->pose.rotation : Pose{}.rotation;
    }
    if (before && (tick.world_shift_m != glm::dvec3(0.0) || options_.convention.origin_m != glm::dvec3(0.0)))
      stay_if_rounded(*before, tick.world_shift_m, update_.poses[i].position_m);
    add_motion(
        sent.ids[i], before, update_.poses[i],
        {derives ? nullptr : &sent.velocities_mps[i], derives_turns ? nullptr : &sent.angular_velocities_radps[i]},
        dt_s);
  }
  if (!derives || dt_s > 0) add_unnamed(ids, dt_s);
}

Session::Track Session::track_of(uint64_t id, const Instance* before, const glm::dvec3& now_m) const {
  if (!before) return {MotionTrack(now_m), {}};
  const auto known = tracks_.find(id);
  return known != tracks_.end() ? known->second : Track{MotionTrack(before->pose.position_m), {}};
}

void Session::add_motion(const MotionEstimate& estimate, const glm::dvec3& angular_velocity_radps) {
  update_.velocities_mps.push_back(estimate.velocity_mps);
  update_.corrections_m.push_back(estimate.correction_m);
  update_.angular_velocities_radps.push_back(angular_velocity_radps);
}

// Adds the motion of an instance that is at `now` after the tick.
void Session::add_motion(uint64_t id, const Instance* before, const Pose& now, const SentMotion& sent, double dt_s) {
  const glm::dvec3 nothing(0.0), sent_mps = sent.velocity_mps ? *sent.velocity_mps : nothing;
  const glm::dvec3 kept_radps = before ? before->angular_velocity_radps : nothing;
  const glm::dvec3 sent_radps = sent.angular_velocity_radps ? *sent.angular_velocity_radps : kept_radps;
  if (before && dt_s <= 0 && now.position_m == before->pose.position_m)
    return add_motion({sent.velocity_mps ? sent_mps : before->velocity_mps, before->correction_m}, sent_radps);
  if (!before || dt_s <= 0) {
    new_tracks_.emplace_back(id, Track{MotionTrack(now.position_m), {}});
    return add_motion({sent_mps, nothing}, sent_radps);
  }
  Track& track = new_tracks_.emplace_back(id, track_of(id, before, now.position_m)).second;
  const MotionEstimate motion = sent.velocity_mps
                                    ? track.motion.observe_sent(dt_s, now.position_m, sent_mps, kTeleportSpeedMps)
                                    : track.motion.observe(dt_s, now.position_m, kTeleportSpeedMps);
  if (sent.angular_velocity_radps) track.turn.observe_sent();
  add_motion(motion,
             sent.angular_velocity_radps ? sent_radps : track.turn.observe(dt_s, before->pose.rotation, now.rotation));
}

// Adds the instances that moved by derived velocities, or were gone on from, and that the tick no longer names: they
// are where they were. A velocity that was sent stays.
void Session::add_unnamed(const IdsAfter& ids, double dt_s) {
  if (derived_moving_.empty() || update_.ids == former_ids_) return;
  std::vector<uint64_t> named = update_.ids;
  std::sort(named.begin(), named.end());
  for (const uint64_t id : derived_moving_) {
    const Instance* instance = ids.staying(id);
    if (!instance || std::binary_search(named.begin(), named.end(), id)) continue;
    const auto track = tracks_.find(id);
    const bool known = track != tracks_.end();
    const bool keeps = known && track->second.motion.has_sent_velocity();
    const glm::dvec3* kept_radps = known && track->second.turn.has_sent_rate() ? &instance->angular_velocity_radps
                                                                               : nullptr;
    update_.ids.push_back(id);
    update_.poses.push_back(instance->pose);
    if (!keeps && dt_s > 0)
      add_motion(id, instance, instance->pose, {nullptr, kept_radps}, dt_s);
    else
      add_motion({keeps ? instance->velocity_mps : glm::dvec3(0.0), {}}, kept_radps ? *kept_radps : glm::dvec3(0.0));
  }
}

void Session::commit(const TickInput& tick) {
  const double dt_s = step_length_s(tick);
  options_.convention.origin_m += tick.world_shift_m;
  remember_motion(tick, dt_s);
  hold(tick.mesh_assets);
  if (tick.targets) options_.targets = *tick.targets;
  if (tick.lens) options_.lens = *tick.lens;
  if (tick.settings) options_.settings = *tick.settings;
  if (tick.limits) options_.limits = *tick.limits;
  if (tick.shot) {
    const uint64_t number = options_.shot.number + 1;
    options_.shot = *tick.shot;
    options_.shot.number = number;
  }
  if (tick.targets || tick.settings || !tick.delta.empty()) take_extents();
  pending_dt_s_ = std::min(pending_dt_s_ + dt_s, kLongestStepS);
  if (tick.observed_camera) observe(*tick.observed_camera, dt_s);
  ++pending_ticks_;
  newest_arrival_ns_ = tick.arrival_ns;
  sequence_ = tick.sequence;
  time_s_ = tick.time_s;
  ticked_ = true;
}

void Session::hold(const std::vector<std::shared_ptr<const SceneAsset>>& assets) {
  auto& held = options_.mesh_assets;
  for (const auto& asset : assets) {
    std::erase(held, asset);
    held.push_back(asset);
  }
  if (held.size() > kHeldAssets) held.erase(held.begin(), held.end() - static_cast<ptrdiff_t>(kHeldAssets));
}

// A tick with dt = 0 derives nothing, so the lists of the tick before it stay.
void Session::remember_motion(const TickInput& tick, double dt_s) {
  for (const uint64_t id : tick.delta.remove) tracks_.erase(id);
  for (auto& [id, track] : new_tracks_) tracks_.insert_or_assign(id, track);
  const bool derives = tick.transforms.velocities_mps.empty();
  if (derives && dt_s <= 0) return;
  derived_moving_.clear();
  const glm::dvec3 none(0.0);
  for (size_t i = 0; i < update_.ids.size(); ++i)
    if ((derives && (update_.velocities_mps[i] != none || update_.angular_velocities_radps[i] != none)) ||
        update_.corrections_m[i] != none)
      derived_moving_.push_back(update_.ids[i]);
  former_ids_ = update_.ids;
}

void Session::observe(const ObservedCamera& observed, double dt_s) {
  const ViewerCamera viewer{observed.pose, observed.velocity_mps, observed.angular_velocity_radps,
                            rounding_m(options_.convention, observed.pose.position_m)};
  bool starts_again = observed.cut;
  if (observed.cut)
    stepper_.place_camera(viewer);
  else
    starts_again = stepper_.observe_camera(viewer);
  pending_cut_ |= observed.cut;
  if (starts_again) pending_dt_s_ = dt_s;
}

Result<SessionAnswer> Session::step(int quality_level) {
  const TakeJob job = begin_step(quality_level);
  return finish_step(job.requests.empty() ? Status{} : sampler_->take(mirror_, job.requests, *job.maps));
}

TakeJob Session::begin_step(int quality_level) {
  step_start_ns_ = clock_();
  quality_level_ = quality_level;
  if (quality_level_ > 0) degraded_ = degrade(options_.settings, quality_level_);
  const StepSettings& settings = quality_level_ > 0 ? degraded_ : options_.settings;
  const StepInput input{mirror_, options_.targets, options_.limits, settings,           options_.lens, options_.seed,
                        steps_,  pending_dt_s_,    extent_views_,   part_extent_views_, &options_.shot};
  const MapOrder order = stepper_.begin(input, clock_);
  take_start_ns_ = clock_();
  return {.sampler = sampler_.get(), .mirror = &mirror_, .requests = order.requests, .maps = order.maps, .taken = {}};
}

Result<SessionAnswer> Session::finish_step(const Status& taken) {
  if (!taken) return tl::unexpected(taken.error());
  const int64_t take_ns = clock_() - take_start_ns_;
  StepResult result = stepper_.finish(clock_);
  result.stage_ns[static_cast<size_t>(Stage::kSample)] += take_ns;
  ++steps_;

  SessionAnswer answer;
  answer.sequence = sequence_;
  answer.time_s = answer.pose_time_s = time_s_;
  answer.step = std::move(result);
  answer.lens = options_.lens;
  answer.lens.vertical_fov_rad = answer.step.vertical_fov_rad;
  const bool observed_cut = std::exchange(pending_cut_, false);
  if (observed_cut && !answer.step.cut) answer.step.reason = MoveReason::kObservedCut;
  answer.cut = observed_cut || answer.step.cut;
  answer.merged_ticks = pending_ticks_ > 0 ? std::exchange(pending_ticks_, 0) - 1 : 0;
  answer.quality_level = quality_level_;
  if (degrades(options_.settings, quality_level_)) answer.degraded = degraded_;
  answer.revision = mirror_.revision();
  answer.hash = mirror_.hash();
  answer.queue_ns = newest_arrival_ns_ > 0 ? std::max<int64_t>(0, step_start_ns_ - newest_arrival_ns_) : 0;
  answer.scene_ns = std::exchange(pending_scene_ns_, 0);
  answer.moved_s = std::min(std::exchange(pending_dt_s_, 0.0), kMaxStepS);
  describe_relative(answer);
  if (Status finite = check_finite(answer); !finite) return tl::unexpected(finite.error());
  return answer;
}

void Session::describe_relative(SessionAnswer& answer) const {
  const Target* target = relative_target(options_.targets);
  if (!target) return;
  const Pose& camera = answer.step.camera.pose;
  const Pose& world_from_target = mirror_.find(target->instance_id)->pose;
  answer.relative_target_id = target->instance_id;
  answer.target_from_camera = {inverse_transform_point(world_from_target, camera.position_m),
                               glm::normalize(glm::conjugate(world_from_target.rotation) * camera.rotation)};
  answer.unrotated_from_camera = {camera.position_m - world_from_target.position_m, camera.rotation};
}

}  // namespace sightline
