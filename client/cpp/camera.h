// A camera whose session survives its daemon. Each tick waits for its reply; a game whose frame must not wait uses
// LiveCamera (live_camera.h).
//
//   auto camera = sightline::Camera::open({"127.0.0.1:50151"}, open);
//   auto answer = camera->tick(tick);      // a CameraReply, a TickError, or the Error of a session that is lost for
//   good
//
// When the stream breaks, the next tick goes on with the session in a new stream: the daemon keeps it for a while (its
// flag --resume-grace-s), and the replies are those of an unbroken stream. When the daemon does not keep it, goes away,
// or says Drain, the next tick opens the session again, in the daemon that answers then, and returns its reply: at the
// camera's last pose, with the scene, targets, settings, limits and lens as they were. Several addresses are tried in
// turn.
//
// A camera must be used by one thread at a time. Nothing throws.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "client/cpp/sightline_client.h"
#include "server/base/error.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

struct CameraOptions {
  // How long a tick waits for a daemon that takes the session over. 0: a lost session is an error at once.
  std::chrono::milliseconds give_up_after{30'000};
  // A daemon that answers nothing for so long is taken for lost.
  std::chrono::milliseconds reply_timeout{5'000};
  // The same for an upload, and for the opening, for which the daemon loads the scene.
  std::chrono::milliseconds open_timeout{30'000};
  // The same for the connection.
  std::chrono::milliseconds connect_timeout{500};
  // The client's own scene file (.glb, or .gltf without other files), as bytes or by its path. Each daemon gets it, and
  // its hash goes into OpenSession.scene.
  std::vector<std::byte> scene;
  std::string scene_file;
  // Files that the opening or a tick names by their hashes. A daemon that does not have one gets it.
  std::vector<std::vector<std::byte>> uploads;
  ClientCredentials credentials;
  // Called by tick() with the reason after the session was opened again.
  std::function<void(const std::string&)> on_resync;
};

class Camera {
 public:
  // The answer to a tick. With a TickError, nothing of the tick was applied, unless it says that the step failed; the
  // session goes on.
  using Answer = std::variant<v1::CameraReply, v1::TickError>;

  // Opens a session with the first of the addresses ("host:port" or "unix:/path") that answers. Also fails as
  // read_scene does.
  static Result<Camera> open(std::vector<std::string> addresses, v1::OpenSession opening, CameraOptions options = {});

  ~Camera();
  Camera(Camera&&) noexcept;
  Camera& operator=(Camera&&) noexcept;

  // Sends what has changed, and returns where the camera goes. The camera numbers ticks whose sequence is 0. Step
  // control must not merge the tick into the next one: kInvalidArgument. After an Error, the next tick tries again.
  Result<Answer> tick(v1::Tick tick);

  // What the daemon said when it opened the session, the last time that one did.
  const v1::SessionOpened& opened() const;
  // How many times the session was opened again, in another daemon or in the same one.
  size_t resyncs() const;
  // How many times it went on in another stream without that.
  size_t resumes() const;

  // Ends the session in order.
  Status close();

  // Ends a tick() that waits on another thread. This call and all later ones fail with kUnavailable.
  void interrupt();

 private:
  struct State;
  explicit Camera(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

// Reads `scene_file` into `scene`, if there is one. kInvalidArgument, field "scene_file", when that cannot be done.
Status read_scene(CameraOptions& options);

// True if another attempt, or another daemon, may help after this error of a tick, or of an opening. A scene file that
// is too large stays so.
bool is_lost(const Error& error, bool opening);

}  // namespace sightline
