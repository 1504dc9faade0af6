// Replies of one stream that wait to be written, and those of the newest turn that were.
//
// A camera reply allocates many small objects. The memory of a written reply is therefore kept and filled again
// for the next one (`take_spare`), unless diagnostics made it large.
//
// If the stream breaks, its client may not have received what was written. The replies of a resumable session are
// therefore kept until its next turn (`keep_written`). A client that sends its next tick has received them as a rule.
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

  // From now on written replies are kept.
  void keep_written() { keeps_ = true; }

  // The first reply is written.
  void pop() {
    if (keeps_ || is_small(replies_.front())) written_.push_back(std::move(replies_.front()));
    replies_.pop_front();
    if (!keeps_ && written_.size() > 1) written_.pop_front();
  }
  // A new turn begins. Returns a written reply to fill again, or an empty one. Its old contents are still in it.
  v1::ControlResponse take_spare() {
    v1::ControlResponse spare;
    if (!written_.empty() && is_small(written_.back())) spare = std::move(written_.back());
    written_.clear();
    return spare;
  }

  // Empties it. Returns the replies since the newest turn began, written or not.
  std::deque<v1::ControlResponse> take_all() {
    for (v1::ControlResponse& reply : replies_) written_.push_back(std::move(reply));
    replies_.clear();
    return std::exchange(written_, {});
  }
  void clear() { replies_.clear(); }

 private:
  static bool is_small(const v1::ControlResponse& reply) {
    return reply.has_camera() && !reply.camera().has_candidates() && reply.camera().depth_maps().empty();
  }

  std::deque<v1::ControlResponse> replies_, written_;
  bool keeps_ = false;
};

}  // namespace sightline
