// A game with two people and a wall, played through a Session in canonical units:
//
//   Game game;
//   game.tick(0.1).move(1, {1, 1, 0});
//   SessionAnswer answer = game.answer();
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <stdexcept>

#include "server/sample/embree_sampler.h"
#include "server/scene/primitives.h"
#include "server/session/session.h"
#include "tests/support/plain_settings.h"

namespace sightline::test {

inline constexpr uint64_t kAnn = 1, kBob = 2, kWall = 10, kCrate = 11;

// One step in time; filled in word by word.
struct TickMaker : TickInput {
  TickMaker& move(uint64_t id, const glm::dvec3& to) {
    transforms.ids.push_back(id);
    transforms.poses.push_back({to, {1, 0, 0, 0}});
    return *this;
  }
  // For all instances that move in this tick.
  TickMaker& at_speed(const glm::dvec3& velocity_mps) {
    transforms.velocities_mps.assign(transforms.ids.size(), velocity_mps);
    return *this;
  }
};

class Game {
 public:
  Game() : Game(first_options) {}
  explicit Game(const std::function<void(SessionOptions&)>& change) {
    SessionOptions options = make_options();
    change(options);
    auto opened = Session::open(std::move(options), device_->make_sampler(), nullptr);
    if (!opened) throw std::runtime_error(to_string(opened.error()));
    session = std::move(*opened);
  }

  SessionOptions make_options() {
    SessionOptions options;
    options.seed = 5;
    options.settings = plain_settings();
    options.instances = {make(kAnn, CapsuleShape{0.3f, 0.6f}, {-1, 1, 0}),
                         make(kBob, CapsuleShape{0.3f, 0.6f}, {1, 1, 0}),
                         make(kWall, BoxShape{{0.3f, 2.0f, 0.1f}}, {0.9, 1, 3}),
                         make(kCrate, BoxShape{{0.5f, 0.5f, 0.5f}}, {0, 0.5, -4})};
    options.targets = {target(kAnn), target(kBob)};
    options.camera.position_m = {0, 1.6, 6};
    return options;
  }
  static void first_options(SessionOptions&) {}

  NewInstance make(uint64_t id, const Shape& shape, const glm::dvec3& at) {
    NewInstance instance;
    instance.id = id;
    instance.geometry = *store_.intern(*tessellate(shape));
    instance.pose.position_m = at;
    return instance;
  }
  static Target target(uint64_t id) {
    Target target;
    target.instance_id = id;
    return target;
  }

  // The next tick, `dt_s` after the one before.
  TickMaker tick(double dt_s = 1.0 / 64) {
    TickMaker tick;
    tick.sequence = ++sequence;
    tick.time_s = time_s += dt_s;
    tick.dt_s = dt_s;
    return tick;
  }
  void apply(const TickInput& tick) {
    const Status ok = session->apply(tick);
    ASSERT_TRUE(ok.has_value()) << to_string(ok.error());
  }
  SessionAnswer answer() {
    auto answer = session->step();
    if (!answer) throw std::runtime_error(to_string(answer.error()));
    return *answer;
  }
  SessionAnswer play(const TickInput& tick) {
    apply(tick);
    return answer();
  }
  const Instance& instance(uint64_t id) { return *session->mirror().find(id); }

  std::unique_ptr<Session> session;
  uint64_t sequence = 0;
  double time_s = 0.0;

 private:
  GeometryStore store_;
  std::unique_ptr<SamplerDevice> device_ = make_embree_sampler_device();
};

inline glm::dvec3 place_of(const SessionAnswer& answer) {
  return answer.step.camera.pose.position_m;
}

inline ObservedCamera seen_at(const glm::dvec3& place, bool cut) {
  return {{place, {1, 0, 0, 0}}, glm::dvec3(0.0), cut};
}

}  // namespace sightline::test
