// The recording of a session whose stream breaks.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <sstream>

#include "client/recordings/commands.h"
#include "client/replay/replay_command.h"
#include "tests/service/recorded_session.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using test::Heard;

constexpr int kBoxes = 6;

v1::Tick box_tick(uint64_t sequence) {
  return move_tick(sequence, 1 + sequence % kBoxes, 0.02 * static_cast<double>(sequence));
}

// Once the stream breaks between two ticks, once while a tick is on its way or is answered, and once while several are.
TEST(RecordingAcrossStreams, ASessionOfSeveralStreamsIsOneRecordingThatReplays) {
  const test::TemporaryFolder scratch;
  const std::string folder = scratch / "recordings";
  Daemon daemon({"--record-dir", folder, "--listen", "127.0.0.1:0"});
  ASSERT_TRUE(daemon.wait_until_ready()) << daemon.errors();
  v1::OpenSession open = open_with_boxes(kBoxes);
  open.set_resumable(true);
  Heard heard(daemon.addresses().front(), open);
  uint64_t sequence = 0;
  // Only the answers of the newest step are sent again. The answers of earlier steps may be lost with the stream that
  // breaks.
  std::set<uint64_t> unheard;
  for (const int unanswered : {0, 1, 3}) {
    for (int i = 0; i < 15; ++i) ASSERT_TRUE(heard.ask(box_tick(++sequence)));
    for (int i = 0; i < unanswered; ++i) heard.send(box_tick(++sequence));
    for (int i = 1; i < unanswered; ++i) unheard.insert(sequence - i);
    ASSERT_TRUE(heard.break_and_resume()) << unanswered;
    ASSERT_TRUE(heard.read_until(sequence)) << unanswered;
  }
  ASSERT_TRUE(heard.ask(box_tick(++sequence)));
  EXPECT_TRUE(heard.finish().ok());
  EXPECT_EQ(server_stats(connect(daemon.addresses().front())).resumed_sessions(), 3u);
  test::stop(daemon);

  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1);
  const std::filesystem::path file = test::only_recording(folder);
  EXPECT_EQ(file.filename(), heard.opened.recording_file());
  const Recording recording = test::open_recording(file);
  EXPECT_TRUE(recording.container().finished);
  EXPECT_EQ(recording.open_session().SerializeAsString(), open.SerializeAsString());
  // The token is a secret.
  v1::SessionOpened opened = heard.opened;
  opened.clear_resume_token();
  opened.clear_resume_grace_s();
  EXPECT_EQ(recording.opened().SerializeAsString(), opened.SerializeAsString());
  for (const v1::CameraReply& reply : heard.replies) unheard.erase(reply.sequence());
  test::FoundInFile found = test::read_all(recording);
  std::erase_if(found.replies, [&](const v1::CameraReply& reply) { return unheard.contains(reply.sequence()); });
  test::expect_same(found, heard);

  std::ostringstream out, err;
  EXPECT_EQ(run_verify_command({.files = {file.string()}}, out, err), 0) << out.str() << err.str();
  std::istringstream nothing;
  EXPECT_EQ(run_replay_command({.file = file.string()}, nothing, out, err), 0) << out.str() << err.str();
}

}  // namespace
}  // namespace sightline
