#include "client/cpp/pose_sampler.h"

#include <algorithm>

#include "client/cpp/rotations.h"

namespace sightline {
namespace {

using namespace live;

constexpr double kFullS = 0.15;  // a reply's velocities carry the camera on in full for so long
constexpr double kStopS = 0.35;  // until then they ease out
constexpr double kFadeS = 0.02;  // what a new reply changes fades in with this time constant

// For how long a reply's velocities have carried the camera at this age: at most 0.25 s.
double carried_s(double age_s) {
  if (age_s <= kFullS) return std::max(age_s, -kFullS);
  const double easing_s = std::min(age_s, kStopS) - kFullS;
  return kFullS + easing_s - easing_s * easing_s / (2 * (kStopS - kFullS));
}

}  // namespace

void PoseSampler::Newest::shift(const Vector& by) {
  pose.position = plus(pose.position, by);
  if (target) target = plus(*target, by);
}

CameraSample PoseSampler::Newest::at(double time, const std::optional<Vector>& target_position) const {
  const double age_s = time - time_s, carried = carried_s(age_s);
  CameraSample shown = pose;
  shown.position = plus(shown.position, times(carried, velocity));
  if (age_s > kFullS && target_position && target)
    shown.position = plus(shown.position, times(1 - carried / age_s, minus(*target_position, *target)));
  shown.rotation = product(rotation_of(times(carried, angular_velocity)), shown.rotation);
  return shown;
}

bool PoseSampler::add(const v1::CameraReply& reply) {
  if (newest_ && reply.sequence() <= sequence_) return false;
  if (!former_ && std::isfinite(time_s_)) former_ = newest_;
  sequence_ = reply.sequence();
  cut_ = cut_ || reply.cut();
  const v1::RelativePose& relative = reply.relative_pose();
  const CameraSample pose{read(reply.pose().position()), read(reply.pose().rotation()), reply.field_of_view(), false};
  newest_ = Newest{reply.pose_time_s(),  pose, read(reply.velocity()), read(reply.angular_velocity()),
                   relative.target_id(), {}};
  if (relative.target_id() != 0 && relative.has_unrotated_pose())
    newest_->target = minus(pose.position, read(relative.unrotated_pose().position()));
  return true;
}

void PoseSampler::shift(const Vector& by) {
  if (newest_) newest_->shift(by);
  if (former_) former_->shift(by);
}

std::optional<CameraSample> PoseSampler::sample(double time_s, const std::optional<Vector>& target_position) {
  if (!newest_) return std::nullopt;
  fade(time_s);
  CameraSample shown = newest_->at(time_s, target_position);
  shown.cut = cut_;
  if (cut_) {
    shift_ = turn_ = {};
    zoom_ = 0;
  } else if (former_) {
    const CameraSample before = former_->at(time_s,
                                            former_->target_id == newest_->target_id ? target_position : std::nullopt);
    shift_ = plus(shift_, minus(before.position, shown.position));
    turn_ = turn_of(product(product(rotation_of(turn_), before.rotation), inverse(shown.rotation)));
    zoom_ += before.field_of_view - shown.field_of_view;
  }
  cut_ = false;
  former_.reset();
  shown.position = plus(shown.position, shift_);
  shown.rotation = product(rotation_of(turn_), shown.rotation);
  shown.field_of_view += zoom_;
  return shown;
}

void PoseSampler::fade(double time_s) {
  if (time_s <= time_s_) return;
  const double left = std::exp(-(time_s - time_s_) / kFadeS);
  shift_ = times(left, shift_);
  turn_ = times(left, turn_);
  zoom_ *= left;
  time_s_ = time_s;
}

}  // namespace sightline
