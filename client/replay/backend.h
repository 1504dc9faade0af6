// Where recorded steps are taken again: a session in this process, or one at a daemon.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/recordings/local_session.h"
#include "server/base/error.h"
#include "server/sample/sampler_choice.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// What became of one step's ticks.
struct ReplayAnswer {
  std::vector<v1::Rejection> rejections;
  bool has_reply = false;  // false: every tick was refused, or none was to be answered yet
  v1::CameraReply reply;
};

// Single-threaded.
class ReplayBackend {
 public:
  virtual ~ReplayBackend() = default;

  // Takes one scene file, without files beside it; answers its hash. Kept until the next open() has been answered.
  virtual Result<std::string> bring(std::span<const std::byte> file) = 0;
  // A new session; a former one ends.
  virtual Result<v1::SessionOpened> open(const v1::OpenSession& open) = 0;
  // Applies the ticks, oldest first, and takes one step for the last of them, at this level of economy; where that is refused,
  // those before it are part of the next step. `answer` comes empty. kUnavailable: the place is gone, and what was applied there
  // is lost.
  virtual Status take(std::span<const v1::Tick> ticks, int economy_level, ReplayAnswer& answer) = 0;
  // Whether it comes back when it is gone (open() then works again); waits for it for no longer than it was told to.
  virtual bool wait_until_back() { return false; }
  // Of the session here; null: it is elsewhere.
  virtual const Session* session() const { return nullptr; }
};

// For places: keeps the session that was opened; answers what it says of itself.
template <typename Opened>
Result<v1::SessionOpened> keep_opened(Result<std::unique_ptr<Opened>> opened, std::unique_ptr<Opened>& kept) {
  if (!opened) return tl::unexpected(std::move(opened.error()));
  kept = std::move(*opened);
  return kept->opened();
}

// Threads for the maps of one session that runs alone: cpu_budget, at most 4. A step takes 60 to 80 maps; what is left
// of it with the maps of more hands is not theirs.
size_t replay_threads();

// In this process. `sampler` is the place's own.
std::unique_ptr<ReplayBackend> make_local_backend(std::unique_ptr<SamplerDevice> sampler);

// A session here that is told everything and takes no step: a mirror to look at. Needs no OpenGL.
std::unique_ptr<ReplayBackend> make_mirror_backend();

// At a daemon. Ticks of one step are merged as they were and each step is taken at its level of economy (Tick.step). The next
// ticks go out when the answer has come. Fails with kUnavailable (field "address") when nobody answers within `patience`,
// which is also how long a daemon that went away is waited for.
Result<std::unique_ptr<ReplayBackend>> connect_backend(const std::string& address,
                                                   std::chrono::nanoseconds patience);

}  // namespace sightline
