// Where recorded steps are taken again: in a session in this process, or in one at a daemon.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/cpp/sightline_client.h"
#include "client/recordings/local_session.h"
#include "server/base/error.h"
#include "server/sample/sampler_choice.h"
#include "sightline/v1/camera_control.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// The answer to one step's ticks.
struct ReplayAnswer {
  std::vector<v1::TickError> rejections;
  bool has_reply = false;  // false: every tick was refused, or no reply is due yet
  v1::CameraReply reply;
};

// Single-threaded.
class ReplayBackend {
 public:
  virtual ~ReplayBackend() = default;

  // Takes one scene file, complete in itself, and returns its hash. The file is kept until the next open() has
  // returned.
  virtual Result<std::string> bring(std::span<const std::byte> file) = 0;
  // Opens a new session; the former one ends.
  virtual Result<v1::SessionOpened> open(const v1::OpenSession& open) = 0;
  // Applies the ticks, oldest first, and takes one step for the last of them at the given level of degradation. When
  // the last tick is refused, the ticks before it belong to the next step. `answer` must be empty. kUnavailable: the
  // backend is gone, and the session with it.
  virtual Status take(std::span<const v1::Tick> ticks, int quality_level, ReplayAnswer& answer) = 0;
  // Applies ticks without a step, and then takes over the memory of the recorded session. Fails with kUnsupported when
  // the backend cannot take a memory, and with kInvalidArgument (field "memory") when this one does not fit.
  virtual Status resume(std::span<const v1::Tick> ticks, const v1::StepMemory& memory) = 0;
  // Waits for a backend that is gone, at most as long as it was configured to. Returns true when open() works again.
  virtual bool wait_until_back() { return false; }
  // The session in this process; null: it is elsewhere.
  virtual const Session* session() const { return nullptr; }
};

// For backends: keeps the session that was opened, and returns its description.
template <typename Opened>
Result<v1::SessionOpened> keep_opened(Result<std::unique_ptr<Opened>> opened, std::unique_ptr<Opened>& kept) {
  if (!opened) return tl::unexpected(std::move(opened.error()));
  kept = std::move(*opened);
  return kept->opened();
}

// Threads for the depth maps of one session that runs alone: cpu_budget, at most 4. A step takes 60 to 80 maps; with
// more threads, the rest of the step dominates.
size_t replay_threads();

// A session in this process, with a sampler of its own.
std::unique_ptr<ReplayBackend> make_local_backend(std::unique_ptr<SamplerDevice> sampler);

// A session in this process that applies everything and takes no step, for its mirror. Needs no OpenGL.
std::unique_ptr<ReplayBackend> make_mirror_backend();

// A session at a daemon. The ticks of one step are merged as they were, and each step is taken at its recorded level of
// degradation (Tick.step). The next ticks are sent when the answer has come. Fails with kUnavailable (field "address")
// when no daemon answers within `timeout`. The same timeout holds for a daemon that went away.
Result<std::unique_ptr<ReplayBackend>> connect_backend(const std::string& address, std::chrono::nanoseconds timeout,
                                                       const ClientCredentials& credentials = {});

}  // namespace sightline
