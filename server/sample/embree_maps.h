// Depth maps of one mirror by Embree's rays, in packets of 16 that share an eye.
//
// Packets never hold rays of two requests, and what is set up for a map depends on the mirror and the request alone: the same
// request gives the same bits, whatever is taken beside it, before it or by whom. (A packet's hits may depend on its company
// where a ray passes through an edge.) A packet is a rectangle of texels, nearly square, so that its rays stay together.
//
// Static instances are met through the device's shared top scene, moving ones each by itself (EmbreeMovers).
#pragma once

#include <memory>
#include <vector>

#include "server/sample/embree_movers.h"

namespace sightline {

// A rectangle of texels that one packet takes, [1, 16] in all.
struct PacketShape {
  int width = 1, height = 1;
};
// Of all shapes the one that covers the map with the fewest packets; of those the one of the least circumference.
PacketShape packet_shape(int map_width, int map_height);

// Takes the maps of one mirror. Not thread-safe; any number may be used at once.
class EmbreeMaps {
 public:
  explicit EmbreeMaps(EmbreeDevice& device);
  ~EmbreeMaps();

  // After every change of the mirror; `ahead_s` is the one value besides 0 that the requests may have, or 0.
  void take_in(const SceneMirror& mirror, double ahead_s);
  // As Sampler::take for one request on the mirror as taken in. Allocates only while `map` grows.
  void take(const SceneMirror& mirror, const MapRequest& request, DepthMap& map);

 private:
  struct Packet;
  void take_packets(const SceneMirror& mirror, const MapRequest& request, DepthMap& map);
  // Of a map of one texel.
  void take_sight(const SceneMirror& mirror, const MapRequest& request, DepthMap& map);
  bool static_filter_needed(const SceneMirror& mirror, const MapRequest& request, const RayCone& cone) const;

  const std::shared_ptr<EmbreeDevice::Impl> device_;  // outlives the scenes below
  uint64_t identity_ = 0, static_version_ = 0;  // of the mirror, as last taken in; identity 0: never
  std::shared_ptr<const StaticTop> fixed_;
  EmbreeMovers movers_;
  // Scratch.
  std::vector<NearMover> near_;
  std::unique_ptr<Packet> packet_;
};

}  // namespace sightline
