// Takes the depth maps of one mirror with Embree's rays, in packets of 16 from one eye.
//
// A packet is a nearly square rectangle of texels, so that its rays are close together. Where a ray passes through an
// edge, its hit may depend on the other rays of the packet. A packet therefore never mixes rays of two requests, and
// its setup depends only on the mirror and the request. So the same request gives the same bits, on any thread and with
// any other requests.
//
// Static instances are traced through the device's shared top scene, moving instances one by one (EmbreeMovers).
#pragma once

#include <memory>
#include <vector>

#include "server/sample/embree_movers.h"

namespace sightline {

// The rectangle of texels of one packet; width * height is in [1, 16].
struct PacketShape {
  int width = 1, height = 1;
};
// The shape that covers the map with the fewest packets, and among those has the smallest circumference.
PacketShape packet_shape(int map_width, int map_height);

// Not thread-safe, but threads may use one each at the same time.
class EmbreeMaps {
 public:
  explicit EmbreeMaps(EmbreeDevice& device);
  ~EmbreeMaps();

  // To be called after every change of the mirror.
  void take_in(const SceneMirror& mirror);
  // Like Sampler::take for one request, on the mirror as of the last take_in. Allocates only while `map` grows.
  void take(const SceneMirror& mirror, const MapRequest& request, DepthMap& map);

 private:
  struct Packet;
  void take_packets(const SceneMirror& mirror, const MapRequest& request, DepthMap& map);
  // Takes a map of one texel.
  void take_sight(const SceneMirror& mirror, const MapRequest& request, DepthMap& map);
  bool static_filter_needed(const SceneMirror& mirror, const MapRequest& request, const RayCone& cone) const;

  const std::shared_ptr<EmbreeDevice::Impl> device_;  // outlives the scenes below
  uint64_t identity_ = 0, static_version_ = 0;        // of the mirror, as last taken in; identity 0: never
  std::shared_ptr<const StaticTop> fixed_;
  EmbreeMovers movers_;
  // Scratch.
  std::vector<NearMover> near_;
  std::unique_ptr<Packet> packet_;
};

}  // namespace sightline
