// Messages as an honest client sends them, drawn at random: what number_storm changes one number of.
#pragma once

#include <memory>
#include <vector>

#include "server/base/random.h"
#include "server/scene/scene_folder.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline::test {

// One of each kind.
std::vector<v1::Shape> usual_shapes();
std::shared_ptr<const Geometry> geometry_of(const v1::Shape& shape, SceneLibrary& library, GeometryStore& store);

class UsualMessages {
 public:
  explicit UsualMessages(CounterRandom& random) : random_(random) {}

  // Up to four targets among boxes, in any convention, with any preset.
  v1::OpenSession open();
  // The tick after the one with this sequence number and time. Targets walk; now and then targets, instances, the lens
  // or the observed camera change.
  v1::Tick tick(uint64_t sequence, double time_s);
  // Fills an empty message of a scene as above.
  void fill(google::protobuf::Message& message);

 private:
  void add_instance(v1::NewInstance& out, uint64_t id);
  void place(v1::Pose3& out);
  double in(double low, double high) { return random_.next_in(low, high) * units_per_m_; }

  CounterRandom& random_;
  double units_per_m_ = 1.0;
  uint64_t targets_ = 1, instances_ = 0, next_id_ = 1;
};

}  // namespace sightline::test
