#include "tests/service/recorded_session.h"

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <csignal>

#include "server/record/record_folder.h"

namespace sightline::test {
namespace {

uint64_t now_ns() {
  return static_cast<uint64_t>(
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
          .count());
}

template <typename Message>
std::vector<std::string> bytes_of(const std::vector<Message>& messages) {
  std::vector<std::string> bytes;
  for (const Message& message : messages) bytes.push_back(message.SerializeAsString());
  return bytes;
}

// The ticks that were not refused. Each refusal names its tick, and refusals come in the order of the ticks.
std::vector<uint64_t> applied(const std::vector<v1::Tick>& ticks, const std::vector<v1::TickError>& refused) {
  std::vector<uint64_t> sequences;
  auto next = refused.begin();
  for (const v1::Tick& tick : ticks) {
    if (next != refused.end() && next->sequence() == tick.sequence()) {
      ++next;
    } else {
      sequences.push_back(tick.sequence());
    }
  }
  return sequences;
}

}  // namespace

Heard::Heard(const std::string& address, const v1::OpenSession& request)
    : open(request), address_(address), stream_(std::make_unique<Stream>(connect(address))) {
  opened = stream_->open(request);
}

void Heard::send(const v1::Tick& tick) {
  sent.push_back(tick);
  stream_->send(tick);
}

bool Heard::break_and_resume() {
  stream_->cancel();
  stream_ = std::make_unique<Stream>(connect(address_));
  v1::ResumeSession request;
  request.set_token(opened.resume_token());
  request.set_answered_sequence(replies.empty() ? 0 : replies.back().sequence());
  stream_->send(request);
  const auto reply = stream_->read();
  if (!reply || !reply->has_opened() || !reply->opened().resumed()) return false;
  for (const v1::Tick& tick : sent)
    if (tick.sequence() > reply->opened().newest_sequence()) stream_->send(tick);
  return true;
}

bool Heard::read_until(uint64_t sequence) {
  while (replies.empty() || replies.back().sequence() < sequence) {
    auto reply = stream_->read();
    if (!reply) return false;
    if (reply->has_tick_error()) rejections.push_back(reply->tick_error());
    if (!reply->has_camera()) continue;
    replies.push_back(reply->camera());
    reply_times_ns.push_back(now_ns());
  }
  return true;
}

grpc::Status Heard::finish() {
  stream_->half_close();
  return stream_->finish();
}

uint64_t hash_of(const std::vector<v1::CameraReply>& replies) {
  uint64_t hash = 0;
  for (const v1::CameraReply& reply : replies) hash = reply_hash(reply, hash);
  return hash;
}

void stop(Daemon& daemon) {
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << daemon.errors();
}

std::filesystem::path only_recording(const std::string& folder) {
  std::vector<std::filesystem::path> found;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) found.push_back(entry.path());
  std::sort(found.begin(), found.end());
  EXPECT_FALSE(found.empty()) << folder;
  for (const auto& path : found) EXPECT_TRUE(is_recording_name(path.filename().string())) << path;
  return found.empty() ? std::filesystem::path() : found.front();
}

Recording open_recording(const std::filesystem::path& file) {
  auto recording = Recording::open(file.string());
  EXPECT_TRUE(recording.has_value()) << to_string(recording.error());
  return std::move(*recording);
}

FoundInFile read_all(const Recording& recording) {
  FoundInFile found;
  StepAssembler steps;
  const RecordedReport report = recording.read({}, [&](RecordedEvent& event) {
    found.last_ns = std::max(found.last_ns, event.log_ns);
    if (event.topic == RecordTopic::kTick) found.ticks.push_back(std::get<v1::Tick>(event.message));
    if (event.topic == RecordTopic::kFault) found.faults.push_back(std::get<v1::Fault>(event.message));
    if (event.topic == RecordTopic::kTickError) found.rejections.push_back(std::get<v1::TickError>(event.message));
    if (!steps.add(event)) return true;
    RecordedStep step = steps.take();
    found.missing += step.missing;
    if (step.missing == 0) {
      const std::vector<uint64_t> covered = applied(step.ticks, step.rejections);
      EXPECT_EQ(covered.size(), step.reply.merged_ticks() + 1u) << step.reply.sequence();
      EXPECT_EQ(covered.empty() ? 0 : covered.back(), step.reply.sequence());
    }
    found.replies.push_back(std::move(step.reply));
    return true;
  });
  EXPECT_EQ(report.undecodable, 0u);
  RecordedStep rest;
  if (steps.take_rest(rest)) found.missing += rest.missing;
  return found;
}

std::vector<uint64_t> sequences_of(const std::vector<v1::CameraReply>& replies) {
  std::vector<uint64_t> sequences;
  for (const v1::CameraReply& reply : replies) sequences.push_back(reply.sequence());
  return sequences;
}

void expect_same(const FoundInFile& found, const Heard& heard) {
  EXPECT_EQ(bytes_of(found.ticks), bytes_of(heard.sent));
  ASSERT_EQ(sequences_of(found.replies), sequences_of(heard.replies));
  EXPECT_EQ(bytes_of(found.replies), bytes_of(heard.replies));
  EXPECT_EQ(bytes_of(found.rejections), bytes_of(heard.rejections));
  EXPECT_EQ(found.missing, 0u);
}

size_t expect_replay(const Recording& recording, LocalWorld& world) {
  auto session = LocalSession::open(recording.open_session(), world);
  EXPECT_TRUE(session.has_value()) << to_string(session.error());
  if (!session) return 0;
  size_t taken = 0, differing = 0;
  StepAssembler steps;
  recording.read({}, [&](RecordedEvent& event) {
    if (!steps.add(event)) return true;
    const RecordedStep step = steps.take();
    std::vector<v1::TickError> refused;
    for (const v1::Tick& tick : step.ticks) {
      v1::TickError rejection;
      if (!(*session)->apply(tick, rejection)) refused.push_back(std::move(rejection));
    }
    EXPECT_EQ(bytes_of(refused), bytes_of(step.rejections));
    v1::CameraReply reply;
    EXPECT_TRUE((*session)->step(step.quality_level(), reply).has_value());
    differing += reply_hash(reply) != reply_hash(step.reply);
    ++taken;
    return true;
  });
  EXPECT_EQ(differing, 0u) << "of " << taken;
  return taken;
}

}  // namespace sightline::test
