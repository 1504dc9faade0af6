#include "client/cpp/display.h"

#include <algorithm>

namespace sightline::live {

Display::Display(const v1::OpenSession& opening, double blend_s)
    : blend_s_(blend_s), places_(opening), centre_(places_.centre({})) {
  shown_ = {read(opening.camera().position()), read(opening.camera().rotation()), opening.lens().field_of_view(),
            false};
  follower_ = Follower{offset(), {}, 0};  // there is no reply so far, so the camera follows from the start
}

Vector Display::offset() const {
  return centre_ ? minus(shown_.position, *centre_) : Vector{};
}

void Display::take_tick(const v1::Tick& tick) {
  if (tick.has_world_shift()) shift_world(tick.sequence(), read(tick.world_shift()));
  const auto before = places_.counted();
  places_.apply(tick);
  if (places_.counted() == before) return;
  // The centre may jump, and the camera must not.
  centre_ = places_.centre({});
  offsets_.clear();
  if (follower_ && centre_) follower_ = Follower{minus(shown_.position, *centre_), {}, tick.time_s()};
}

void Display::take_reply(v1::CameraReply reply) {
  if (!follower_ || reply.sequence() >= counts_from_) sampler_.add(in_this_world(reply));
  newest_ = std::move(reply);
}

void Display::shift_world(uint64_t sequence, const Vector& by) {
  shifts_.emplace_back(sequence, by);
  shown_.position = plus(shown_.position, by);
  if (centre_) centre_ = plus(*centre_, by);
  places_.shift(by);
  sampler_.shift(by);
  motion_.shift(by);
}

// The reply where the world has been shifted since its tick.
v1::CameraReply Display::in_this_world(v1::CameraReply reply) {
  std::erase_if(shifts_, [&](const auto& shift) { return shift.first <= reply.sequence(); });
  v1::Vec3& position = *reply.mutable_pose()->mutable_position();
  for (const auto& [sequence, by] : shifts_)
    position.set_x(position.x() + by[0]), position.set_y(position.y() + by[1]), position.set_z(position.z() + by[2]);
  return reply;
}

void Display::follow(uint64_t counts_from) {
  if (!follower_) {
    follower_ = Follower{offset(), relative_velocity(), shown_s_};
    has_followed_ = false;
  } else if (counts_from_ > 0) {
    return;
  }
  counts_from_ = counts_from;
  sampler_ = {};
  blend_.reset();
}

// No faster than the camera of the newest reply: targets that are put elsewhere do not throw it.
Vector Display::relative_velocity() const {
  if (offsets_.size() < 2 || !newest_) return {};
  const Vector velocity = times(1 / (offsets_[1].first - offsets_[0].first),
                                minus(offsets_[1].second, offsets_[0].second));
  const double most = length(read(newest_->velocity())), speed = length(velocity);
  return speed <= most ? velocity : times(most / speed, velocity);
}

std::pair<CameraSample, LiveSource> Display::show(double time_s, const Drawn& drawn) {
  const auto centre = places_.centre(drawn);
  std::pair<CameraSample, LiveSource> shown;
  const auto daemon = sampler_.sample(time_s, places_.position(sampler_.target_id(), drawn));
  if (daemon) {
    if (follower_) go_back(followed(time_s, centre), *daemon, time_s);
    shown = blended(*daemon, time_s);
  } else {  // there is a follower until there is a reply
    shown = {followed(time_s, centre), LiveSource::kFallback};
    has_followed_ = true;
  }
  remember(shown.first, time_s, centre);
  return shown;
}

v1::ObservedCamera Display::observed() const {
  v1::ObservedCamera observed;
  v1::Vec3 &position = *observed.mutable_pose()->mutable_position(), &velocity = *observed.mutable_velocity();
  const Vector moving = motion_.velocity();
  position.set_x(shown_.position[0]), position.set_y(shown_.position[1]), position.set_z(shown_.position[2]);
  velocity.set_x(moving[0]), velocity.set_y(moving[1]), velocity.set_z(moving[2]);
  v1::Quat& rotation = *observed.mutable_pose()->mutable_rotation();
  rotation.set_x(shown_.rotation[0]), rotation.set_y(shown_.rotation[1]), rotation.set_z(shown_.rotation[2]);
  rotation.set_w(shown_.rotation[3]);
  return observed;
}

CameraSample Display::followed(double time_s, const std::optional<Vector>& centre) const {
  CameraSample sample = shown_;
  sample.cut = false;
  if (centre) sample.position = follower_->at(time_s, *centre);
  return sample;
}

void Display::go_back(const CameraSample& followed, const CameraSample& daemon, double time_s) {
  follower_.reset();
  if (!has_followed_) return;
  blend_ = Blend{time_s, minus(followed.position, daemon.position),
                 turn_of(product(followed.rotation, inverse(daemon.rotation))),
                 followed.field_of_view - daemon.field_of_view};
}

std::pair<CameraSample, LiveSource> Display::blended(const CameraSample& daemon, double time_s) {
  const double left = blend_ && !daemon.cut ? share_left(time_s) : 0;
  if (left == 0) {
    blend_.reset();
    return {daemon, LiveSource::kPredicted};
  }
  CameraSample shown = daemon;
  shown.position = plus(shown.position, times(left, blend_->shift));
  shown.rotation = product(rotation_of(times(left, blend_->turn)), shown.rotation);
  shown.field_of_view += left * blend_->zoom;
  return {shown, LiveSource::kBlend};
}

double Display::share_left(double time_s) const {
  const double x = blend_s_ > 0 ? std::clamp((time_s - blend_->since_s) / blend_s_, 0.0, 1.0) : 1.0;
  return 1 - x * x * (3 - 2 * x);
}

void Display::remember(const CameraSample& sample, double time_s, const std::optional<Vector>& centre) {
  shown_ = sample;
  shown_s_ = time_s;
  centre_ = centre;
  motion_.add(time_s, sample.position);
  if (!centre || sample.cut) offsets_.clear();
  if (!centre || (!offsets_.empty() && time_s <= offsets_.back().first)) return;
  offsets_.emplace_back(time_s, minus(sample.position, *centre));
  if (offsets_.size() > 2) offsets_.erase(offsets_.begin());
}

}  // namespace sightline::live
