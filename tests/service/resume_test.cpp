// Sessions that outlive their stream.
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "tests/service/service_world.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using namespace std::chrono_literals;

v1::OpenSession resumable(int boxes = 3) {
  v1::OpenSession open = open_with_boxes(boxes);
  open.set_resumable(true);
  return open;
}

v1::Tick tick(uint64_t sequence) {
  return move_tick(sequence, 1, 0.02 * static_cast<double>(sequence));
}

v1::CameraReply ask(Stream& stream, uint64_t sequence) {
  EXPECT_TRUE(stream.send(tick(sequence)));
  const auto reply = stream.read();
  EXPECT_TRUE(reply && reply->has_camera()) << (reply ? reply->DebugString() : stream.finish().error_message());
  return reply ? reply->camera() : v1::CameraReply{};
}

v1::ResumeSession resume_of(const v1::SessionOpened& opened, uint64_t answered) {
  v1::ResumeSession request;
  request.set_token(opened.resume_token());
  request.set_answered_sequence(answered);
  return request;
}

// Returns the first answer of a stream that resumes the session.
v1::SessionOpened resume(Stream& stream, const v1::SessionOpened& opened, uint64_t answered) {
  EXPECT_TRUE(stream.send(resume_of(opened, answered)));
  const auto reply = stream.read();
  EXPECT_TRUE(reply && reply->has_opened()) << (reply ? reply->DebugString() : stream.finish().error_message());
  return reply ? reply->opened() : v1::SessionOpened{};
}

std::string without_times(v1::CameraReply reply) {
  reply.clear_stage_times();
  return reply.SerializeAsString();
}

// False when it did not come true in time.
template <typename Condition>
bool becomes(const Condition& condition, std::chrono::seconds patience = 20s) {
  for (const auto end = std::chrono::steady_clock::now() + patience; std::chrono::steady_clock::now() < end;
       std::this_thread::sleep_for(2ms))
    if (condition()) return true;
  return false;
}

// Returns the text of the refusal.
std::string expect_not_kept(const std::string& address, const v1::ResumeSession& request) {
  Stream stream(connect(address));
  stream.send(request);
  const grpc::Status status = stream.finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND) << status.error_message();
  EXPECT_EQ(fields_of(status), std::vector<std::string>{"resume.token"});
  return status.error_message();
}

void expect_not_kept(const ServiceWorld& world, const v1::ResumeSession& request) {
  expect_not_kept(world.address(), request);
}

WorldOptions with_grace(std::chrono::milliseconds grace) {
  WorldOptions options;
  options.limits.resume_grace = grace;
  return options;
}

TEST(Resume, ABrokenSessionGoesOnWithTheRepliesOfAnUnbrokenOne) {
  ServiceWorld world;
  Stream unbroken(world.channel()), first(world.channel()), second(world.channel());
  unbroken.open(resumable());
  const v1::SessionOpened opened = first.open(resumable());
  EXPECT_GE(opened.resume_token().size(), 16u);
  EXPECT_EQ(opened.resume_grace_s(), 10.0);
  EXPECT_FALSE(opened.resumed());
  for (uint64_t i = 1; i <= 10; ++i) EXPECT_EQ(without_times(ask(unbroken, i)), without_times(ask(first, i)));
  first.cancel();
  ASSERT_TRUE(becomes([&] { return world.stats().kept_sessions() == 1; }));
  const v1::SessionOpened again = resume(second, opened, 10);
  EXPECT_TRUE(again.resumed());
  EXPECT_EQ(again.newest_sequence(), 10u);
  EXPECT_EQ(again.session_id(), opened.session_id());
  EXPECT_EQ(again.mirror_revision(), opened.mirror_revision());
  EXPECT_EQ(again.resume_token(), opened.resume_token());
  for (uint64_t i = 11; i <= 20; ++i) EXPECT_EQ(without_times(ask(unbroken, i)), without_times(ask(second, i)));
  const v1::GetServerStatsResponse stats = world.stats();
  EXPECT_EQ(stats.open_sessions(), 2u);
  EXPECT_EQ(stats.opened_sessions(), 2u);
  EXPECT_EQ(stats.kept_sessions(), 0u);
  EXPECT_EQ(stats.resumed_sessions(), 1u);
}

TEST(Resume, AnAnswerThatItsClientLacksIsSentAgain) {
  ServiceWorld world;
  Stream first(world.channel()), second(world.channel()), third(world.channel());
  const v1::SessionOpened opened = first.open(resumable());
  ask(first, 1);
  const v1::CameraReply lost = ask(first, 2);
  first.cancel();
  EXPECT_EQ(resume(second, opened, 1).newest_sequence(), 2u);
  const auto again = second.read();
  ASSERT_TRUE(again && again->has_camera());
  EXPECT_EQ(again->camera().SerializeAsString(), lost.SerializeAsString());
  // A refusal is an answer as well.
  second.send(move_tick(3, 99, 0.0));
  const auto refused = second.read();
  ASSERT_TRUE(refused && refused->has_tick_error());
  second.cancel();
  EXPECT_EQ(resume(third, opened, 2).newest_sequence(), 3u);
  const auto refused_again = third.read();
  ASSERT_TRUE(refused_again && refused_again->has_tick_error());
  EXPECT_EQ(refused_again->tick_error().sequence(), 3u);
  EXPECT_EQ(ask(third, 4).sequence(), 4u);
}

// How a stream ends whose session another one has taken. It is cancelled where gRPC has not reported yet that the last
// reply was written, since a write to a client that is gone would not end.
bool gave_up(const grpc::Status& status) {
  return status.error_code() == grpc::StatusCode::ABORTED || status.error_code() == grpc::StatusCode::CANCELLED;
}

TEST(Resume, AStreamThatIsStillUpGivesTheSessionUp) {
  ServiceWorld world;
  Stream first(world.channel()), second(world.channel());
  const v1::SessionOpened opened = first.open(resumable());
  ask(first, 1);
  EXPECT_TRUE(resume(second, opened, 1).resumed());
  EXPECT_TRUE(gave_up(first.finish()));
  EXPECT_EQ(ask(second, 2).sequence(), 2u);
  EXPECT_EQ(world.stats().open_sessions(), 1u);
}

TEST(Resume, AStreamWhoseStepIsUnderWayGivesTheSessionUpAfterIt) {
  ServiceWorld world;
  Stream first(world.channel()), second(world.channel());
  const v1::SessionOpened opened = first.open(resumable());
  ask(first, 1);
  world.device.close_gate();
  first.send(tick(2));
  world.device.wait_until_held(1);
  second.send(resume_of(opened, 1));
  world.device.open_gate();
  const auto reply = second.read();
  ASSERT_TRUE(reply && reply->has_opened()) << second.finish().error_message();
  EXPECT_EQ(reply->opened().newest_sequence(), 2u);
  const auto answer = second.read();
  ASSERT_TRUE(answer && answer->has_camera());
  EXPECT_EQ(answer->camera().sequence(), 2u);
  EXPECT_TRUE(gave_up(first.finish()));
}

// A connection whose other end is gone takes no more bytes.
TEST(Resume, AStreamThatTakesNoMoreBytesGivesTheSessionUp) {
  ServiceWorld world;
  Stream first(world.channel());
  v1::OpenSession open = resumable();
  open.mutable_diagnostics()->set_candidates(true);
  const v1::SessionOpened opened = first.open(open);
  // Nobody reads the replies. With their candidates they fill the window of the stream, which is 64 KiB; then the
  // server waits.
  const auto steps_done = [&](uint64_t sent) { return world.stats().steps() >= sent; };
  uint64_t sent = 0;
  do {
    first.send(tick(++sent));
  } while (sent < 100 && becomes([&] { return steps_done(sent); }, 1s));
  ASSERT_LT(sent, 100u) << "the server wrote on";
  Stream second(world.channel());
  EXPECT_TRUE(resume(second, opened, 0).resumed());
  const auto answer = second.read();
  ASSERT_TRUE(answer && answer->has_camera());
}

TEST(Resume, TheTokenMustBeRight) {
  ServiceWorld world;
  Stream first(world.channel());
  const v1::SessionOpened opened = first.open(resumable());
  ask(first, 1);
  v1::ResumeSession wrong = resume_of(opened, 1);
  wrong.mutable_token()->back() ^= 1;
  expect_not_kept(world, wrong);
  wrong = resume_of(opened, 1);
  wrong.mutable_token()->pop_back();
  expect_not_kept(world, wrong);
  expect_not_kept(world, {});
  // The session went on meanwhile.
  EXPECT_EQ(ask(first, 2).sequence(), 2u);
  EXPECT_EQ(world.stats().refused_resumes(), 3u);
}

// A client over TCP is known by its address, one over the unix socket by its user.
TEST(Resume, AStolenTokenIsOfNoUseToAnotherClient) {
  const test::TemporaryFolder folder;
  WorldOptions options;
  options.unix_path = folder / "socket";
  ServiceWorld world(options);
  const std::string unix_address = "unix:" + options.unix_path;
  uint64_t refused = 0;
  for (const auto& [owner, thief] :
       {std::pair(world.address(), unix_address), std::pair(unix_address, world.address())}) {
    Stream first(connect(owner)), second(connect(owner));
    const v1::SessionOpened opened = first.open(resumable());
    ask(first, 1);
    v1::ResumeSession guessed = resume_of(opened, 1);
    guessed.mutable_token()->back() ^= 1;
    const std::string text = expect_not_kept(thief, guessed);
    EXPECT_EQ(expect_not_kept(thief, resume_of(opened, 1)), text) << "it does not say that the token is right";
    EXPECT_EQ(ask(first, 2).sequence(), 2u) << "the stream of the owner has the session as before";
    first.cancel();
    ASSERT_TRUE(becomes([&] { return world.stats().kept_sessions() == 1; }));
    EXPECT_EQ(expect_not_kept(thief, resume_of(opened, 2)), text);
    EXPECT_EQ(world.stats().kept_sessions(), 1u) << "it still waits for its owner";
    EXPECT_EQ(world.stats().refused_resumes(), refused += 3);
    EXPECT_TRUE(resume(second, opened, 2).resumed());
    EXPECT_EQ(ask(second, 3).sequence(), 3u);
    second.half_close();
    EXPECT_TRUE(second.finish().ok());
  }
}

TEST(Resume, ASessionThatEndsInOrderIsNotKept) {
  ServiceWorld world;
  v1::SessionOpened opened;
  {
    Stream first(world.channel());
    opened = first.open(resumable());
    ask(first, 1);
    first.half_close();
    EXPECT_TRUE(first.finish().ok());
  }
  EXPECT_TRUE(becomes([&] { return world.stats().open_sessions() == 0; }));
  EXPECT_EQ(world.stats().kept_sessions(), 0u);
  expect_not_kept(world, resume_of(opened, 1));
}

TEST(Resume, OnlySessionsWhoseClientAsksAreKept) {
  ServiceWorld world;
  Stream first(world.channel());
  EXPECT_EQ(first.open(open_with_boxes(2)).resume_token(), "");
  ask(first, 1);
  first.cancel();
  EXPECT_TRUE(becomes([&] { return world.stats().open_sessions() == 0; }));
}

TEST(Resume, NothingIsKeptWithoutGrace) {
  ServiceWorld world(with_grace(0ms));
  Stream first(world.channel());
  EXPECT_EQ(first.open(resumable()).resume_token(), "");
  first.cancel();
  EXPECT_TRUE(becomes([&] { return world.stats().open_sessions() == 0; }));
}

TEST(Resume, AKeptSessionEndsWithTheGraceTime) {
  ServiceWorld world(with_grace(50ms));
  Stream first(world.channel());
  const v1::SessionOpened opened = first.open(resumable());
  first.cancel();
  EXPECT_TRUE(becomes([&] { return world.stats().expired_sessions() == 1; }));
  EXPECT_TRUE(becomes([&] { return world.stats().open_sessions() == 0; }));
  EXPECT_EQ(world.geometry_count(), 0u);
  expect_not_kept(world, resume_of(opened, 0));
}

TEST(Resume, AServerThatDrainsKeepsNothing) {
  ServiceWorld world;
  Stream first(world.channel()), second(world.channel());
  first.open(resumable());
  second.open(resumable());
  first.cancel();
  ASSERT_TRUE(becomes([&] { return world.stats().kept_sessions() == 1; }));
  world.streams.drain("going away");
  EXPECT_EQ(world.streams.size(), 1u);
  second.cancel();
  EXPECT_TRUE(becomes([&] { return world.streams.size() == 0; }));
  EXPECT_EQ(world.stats().kept_sessions(), 0u);
}

TEST(Resume, AKeptSessionTakesAPlaceWhichItsStreamGetsBack) {
  WorldOptions options;
  options.max_sessions = 1;
  ServiceWorld world(options);
  Stream first(world.channel()), second(world.channel()), other(world.channel());
  const v1::SessionOpened opened = first.open(resumable());
  first.cancel();
  ASSERT_TRUE(becomes([&] { return world.stats().kept_sessions() == 1; }));
  other.send(open_with_boxes(2));
  const grpc::Status full = other.finish();
  EXPECT_EQ(full.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_GT(retry_seconds_of(full), 0);
  EXPECT_TRUE(resume(second, opened, 0).resumed());
  EXPECT_EQ(ask(second, 1).sequence(), 1u);
  EXPECT_EQ(world.streams.size(), 1u);
  second.half_close();
  EXPECT_TRUE(second.finish().ok());
  EXPECT_TRUE(becomes([&] { return world.streams.size() == 0; }));
}

TEST(Resume, ResumeMustBeTheFirstMessage) {
  ServiceWorld world;
  Stream first(world.channel());
  const v1::SessionOpened opened = first.open(resumable());
  first.send(resume_of(opened, 0));
  const auto reply = first.read();
  ASSERT_TRUE(reply && reply->has_tick_error());
  EXPECT_EQ(reply->tick_error().code(), v1::TickError::CODE_FAILED_PRECONDITION);
  EXPECT_EQ(reply->tick_error().field_violations(0).field(), "resume");
  EXPECT_EQ(ask(first, 1).sequence(), 1u);
}

// Streams break and take over in every order, while steps are under way.
TEST(Resume, ManyStreamsOfManySessionsMayComeAtOnce) {
  WorldOptions options;
  options.real_time = true;
  ServiceWorld world(options);
  std::vector<std::thread> clients;
  for (int client = 0; client < 4; ++client) {
    clients.emplace_back([&world, client] {
      auto stream = std::make_unique<Stream>(world.channel());
      const v1::SessionOpened opened = stream->open(resumable());
      uint64_t answered = 0;
      for (uint64_t round = 1; round <= 40; ++round) {
        stream->send(tick(answered + 1));
        if ((round + static_cast<uint64_t>(client)) % 3 == 0) stream->cancel();
        auto next = std::make_unique<Stream>(world.channel());
        const v1::SessionOpened again = resume(*next, opened, answered);
        ASSERT_TRUE(again.resumed());
        ASSERT_LE(again.newest_sequence(), answered + 1);
        if (again.newest_sequence() == answered) next->send(tick(answered + 1));
        const auto reply = next->read();
        ASSERT_TRUE(reply && reply->has_camera());
        ASSERT_EQ(reply->camera().sequence(), ++answered);
        stream = std::move(next);
      }
    });
  }
  for (std::thread& client : clients) client.join();
  EXPECT_TRUE(becomes([&] { return world.stats().kept_sessions() == 4; }));  // ended by destroyed streams, not in order
  EXPECT_EQ(world.stats().resumed_sessions(), 160u);
  EXPECT_EQ(world.streams.size(), 4u);
}

class NoStream final : public Drainable {
 public:
  void drain(const std::string&) override {}
  void end(const grpc::Status&) override {}
};

TEST(Resume, AClientMayHaveAsManyWaitingStreamsAsPlaces) {
  StreamRegistry registry(2, 1);
  const auto a = std::make_shared<NoStream>(), b = std::make_shared<NoStream>(), c = std::make_shared<NoStream>();
  EXPECT_FALSE(registry.add_waiting(a, "one"));
  EXPECT_EQ(registry.add(a, "one"), Admission::kAdmitted);
  EXPECT_EQ(registry.add(b, "one"), Admission::kClientFull);
  EXPECT_TRUE(registry.add_waiting(b, "one"));
  EXPECT_FALSE(registry.add_waiting(c, "one"));
  EXPECT_FALSE(registry.add_waiting(c, "two"));
  EXPECT_EQ(registry.size(), 1u);
  EXPECT_TRUE(registry.move_place(a.get(), b));
  EXPECT_EQ(registry.size(), 1u);
  EXPECT_TRUE(registry.add_waiting(c, "one"));
  registry.remove(c.get());
  registry.remove(b.get());
  EXPECT_EQ(registry.size(), 0u);
  EXPECT_FALSE(registry.move_place(a.get(), c));
  EXPECT_EQ(registry.add(c, "one"), Admission::kAdmitted);
}

}  // namespace
}  // namespace sightline
