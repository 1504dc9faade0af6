// A failure of a recording never changes a reply. It is flagged, counted and logged once.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include "tests/service/recorded_session.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using test::Heard;
using testing::HasSubstr;

constexpr int kBoxes = 6;

v1::Tick box_tick(uint64_t sequence) {
  return move_tick(sequence, 1 + sequence % kBoxes, 0.01 * static_cast<double>(sequence));
}

size_t count(const std::string& text, const std::string& part) {
  size_t found = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

class RecordingTrouble : public testing::Test {
 protected:
  void start(const std::string& folder, std::vector<std::string> flags = {}) {
    flags.insert(flags.end(), {"--listen", "127.0.0.1:0", "--record-dir", folder});
    daemon_ = std::make_unique<Daemon>(flags);
    ASSERT_TRUE(daemon_->wait_until_ready()) << daemon_->errors();
    heard_ = std::make_unique<Heard>(daemon_->addresses().front(), open_with_boxes(kBoxes));
  }
  bool flagged() const { return heard_->replies.back().flags().recording_degraded(); }
  // Sends ticks, each answered, until the condition holds.
  void play_until(const std::function<bool()>& reached) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(40);
    do {
      ASSERT_LT(std::chrono::steady_clock::now(), deadline) << daemon_->errors();
      ASSERT_TRUE(heard_->ask(box_tick(heard_->sent.size() + 1)));
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    } while (!reached());
  }
  void play(size_t ticks) {
    const size_t end = heard_->sent.size() + ticks;
    play_until([&] { return heard_->sent.size() == end; });
  }
  v1::RecordingStats counts() const { return server_stats(connect(daemon_->addresses().front())).recording(); }
  size_t logged(const std::string& message) const {
    return count(daemon_->errors(), message + " session=" + heard_->opened.session_id());
  }
  // That the file cannot be written. A queue that runs over meanwhile, as in a test that is faster than a game, has a
  // message of its own.
  size_t logged_failure() const {
    return count(daemon_->errors(), "warning recording degraded session=" + heard_->opened.session_id() +
                                        " reason=\"the recording cannot be written");
  }
  // That the file is written again. A queue that ran over meanwhile has a message of its own.
  size_t logged_recovery() const {
    return count(daemon_->errors(),
                 "recording recovered session=" + heard_->opened.session_id() + " reason=\"it is written again\"");
  }
  // The same ticks at a daemon that does not record.
  uint64_t hash_without_recording() const {
    Daemon plain({"--listen", "127.0.0.1:0"});
    EXPECT_TRUE(plain.wait_until_ready());
    Heard heard(plain.addresses().front(), heard_->open);
    for (const v1::Tick& tick : heard_->sent) EXPECT_TRUE(heard.ask(tick));
    return test::hash_of(heard.replies);
  }
  // Apart from the flag, the replies equal the replies of a session that is not recorded.
  void expect_unharmed() {
    EXPECT_TRUE(heard_->finish().ok());
    EXPECT_EQ(heard_->replies.size(), heard_->sent.size());
    EXPECT_EQ(test::hash_of(heard_->replies), hash_without_recording());
  }

  const test::TemporaryFolder scratch_;
  const std::string folder_ = scratch_ / "recordings";
  std::unique_ptr<Daemon> daemon_;
  std::unique_ptr<Heard> heard_;
};

TEST_F(RecordingTrouble, AFolderThatGoesAndComesBack) {
  start(folder_);
  play_until([&] { return counts().bytes() > 0; });
  EXPECT_FALSE(flagged());
  EXPECT_EQ(counts().failing_sessions(), 0u);
  fs::remove_all(folder_);
  std::ofstream(folder_) << "in the way";
  play_until([&] { return flagged(); });
  play_until([&] { return counts().write_failures() > 2; });
  EXPECT_EQ(counts().failing_sessions(), 1u);
  EXPECT_GT(counts().dropped_messages(), 0u);
  EXPECT_EQ(logged_failure(), 1u) << daemon_->errors();
  EXPECT_EQ(logged_recovery(), 0u);

  fs::remove(folder_);
  play_until([&] { return !flagged(); });
  const size_t recovered = heard_->replies.size();
  play(40);
  EXPECT_EQ(logged_recovery(), 1u) << daemon_->errors();
  EXPECT_EQ(counts().failing_sessions(), 0u);
  expect_unharmed();
  test::stop(*daemon_);

  // The file reports what is missing, and holds everything after it.
  const fs::path file = test::only_recording(folder_);
  EXPECT_NE(file.filename(), heard_->opened.recording_file()) << "a later part";
  const Recording recording = test::open_recording(file);
  EXPECT_EQ(recording.open_session().SerializeAsString(), heard_->open.SerializeAsString());
  const test::FoundInFile found = test::read_all(recording);
  EXPECT_GT(found.missing, 0u);
  ASSERT_GE(found.replies.size(), heard_->replies.size() - recovered);
  const size_t before = heard_->replies.size() - found.replies.size();
  for (size_t i = 0; i < found.replies.size(); ++i)
    EXPECT_EQ(found.replies[i].SerializeAsString(), heard_->replies[before + i].SerializeAsString()) << i;
}

// A folder that was deleted is created again.
TEST_F(RecordingTrouble, ARemovedFolderIsMadeAgain) {
  start(folder_);
  play_until([&] { return counts().bytes() > 0; });
  // The daemon may write into it meanwhile.
  for (std::error_code trouble; fs::exists(folder_);) fs::remove_all(folder_, trouble);
  play_until([&] { return counts().files() > 1 && counts().failing_sessions() == 0; });
  play(20);
  EXPECT_EQ(logged_failure(), 1u) << daemon_->errors();
  expect_unharmed();
  test::stop(*daemon_);
  EXPECT_GT(test::read_all(test::open_recording(test::only_recording(folder_))).missing, 0u);
}

TEST_F(RecordingTrouble, TheDisksReserveIsLeftAlone) {
  start(folder_, {"--record-reserve-mib", "1073741824"});
  play_until([&] { return flagged(); });
  play_until([&] { return counts().write_failures() > 1; });
  EXPECT_EQ(counts().failing_sessions(), 1u);
  EXPECT_EQ(counts().bytes(), 0u);
  EXPECT_EQ(logged("warning recording degraded"), 1u) << daemon_->errors();
  EXPECT_THAT(daemon_->errors(), HasSubstr("no space for recordings"));
  expect_unharmed();
  test::stop(*daemon_);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(RecordingTrouble, AFolderThatCannotBeMadeDoesNotKeepTheDaemonFromStarting) {
  std::ofstream(scratch_ / "file") << "not a folder";
  start(scratch_ / "file/recordings");
  play_until([&] { return flagged(); });
  EXPECT_EQ(counts().failing_sessions(), 1u);
  EXPECT_EQ(logged("warning recording degraded"), 1u) << daemon_->errors();
  expect_unharmed();
  test::stop(*daemon_);
}

}  // namespace
}  // namespace sightline
