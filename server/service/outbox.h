// Replies of one stream that wait to be written, and the memory of the last one that was.
//
// A camera reply allocates many small objects. The memory of a written reply is therefore kept and filled again
// for the next one (`take_spare`), unless diagnostics made it large.
#pragma once

#include <deque>
#include <utility>

#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Not thread-safe. ControlStream bounds its length: it takes no step before the outbox is empty.
class Outbox {
 public:
  bool empty() const { return replies_.empty(); }
  void push(v1::ControlResponse reply) { replies_.push_back(std::move(reply)); }
  // The next reply to write. The reference stays valid until `pop`. The outbox must not be empty.
  const v1::ControlResponse& front() const { return replies_.front(); }

  // The first reply is written.
  void pop() {
    if (is_small(replies_.front())) spare_ = std::move(replies_.front());
    replies_.pop_front();
  }
  // A written reply to fill again, or an empty one. Its old contents are still in it.
  v1::ControlResponse take_spare() { return std::move(spare_); }

  void clear() { replies_.clear(); }

 private:
  static bool is_small(const v1::ControlResponse& reply) {
    return reply.has_camera() && !reply.camera().has_candidates() && reply.camera().depth_maps().empty();
  }

  std::deque<v1::ControlResponse> replies_;
  v1::ControlResponse spare_;
};

}  // namespace sightline
