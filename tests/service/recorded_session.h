// A session at a real daemon: what its client sent and received, and the file that the daemon recorded.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "client/recordings/local_session.h"
#include "client/recordings/recording.h"
#include "tests/service/daemon.h"
#include "tests/service/service_world.h"

namespace sightline::test {

// A client that keeps all messages. Single-threaded.
class Heard {
 public:
  Heard(const std::string& address, const v1::OpenSession& open);

  void send(const v1::Tick& tick);
  // Reads until the reply to this tick has come; rejections on the way are kept. False when the call has ended.
  bool read_until(uint64_t sequence);
  // Breaks the stream and goes on with the session in another one, as clients do: ticks that were not applied are sent
  // again. Their answers are for read_until. False when the server does not have the session any more.
  bool break_and_resume();
  bool ask(const v1::Tick& tick) {
    send(tick);
    return read_until(tick.sequence());
  }
  // Ends the call in order.
  grpc::Status finish();

  v1::OpenSession open;
  v1::SessionOpened opened;
  std::vector<v1::Tick> sent;
  std::vector<v1::CameraReply> replies;
  std::vector<v1::TickError> rejections;
  std::vector<uint64_t> reply_times_ns;  // when they came, since 1970 (UTC)

 private:
  const std::string address_;
  std::unique_ptr<Stream> stream_;
};

// Chained over all replies.
uint64_t hash_of(const std::vector<v1::CameraReply>& replies);

// Stops with SIGTERM and expects an orderly end: the files are then finished.
void stop(Daemon& daemon);

// The only recording in a folder, or the first part of several.
std::filesystem::path only_recording(const std::string& folder);
Recording open_recording(const std::filesystem::path& file);

struct FoundInFile {
  std::vector<v1::Tick> ticks;
  std::vector<v1::CameraReply> replies;
  std::vector<v1::TickError> rejections;
  std::vector<v1::Fault> faults;
  uint64_t missing = 0;  // as gaps say
  uint64_t last_ns = 0;  // of the last message
};
// Expects every reply directly after the ticks that it covers.
FoundInFile read_all(const Recording& recording);

// Expects every bit of what the client sent and received in the file, and nothing else.
void expect_same(const FoundInFile& found, const Heard& heard);

// Takes every step of the recording again in this process and expects the same bits. Returns the number of steps.
size_t expect_replay(const Recording& recording, LocalWorld& world);

}  // namespace sightline::test
