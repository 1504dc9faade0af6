// The C++ client library against a daemon of its own.
#include "client/cpp/sightline_client.h"

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <numbers>
#include <set>
#include <thread>

#include "scenes/glb_writer.h"
#include "server/base/hash.h"
#include "server/scene/gltf.h"
#include "server/scene/primitives.h"
#include "sightline/v1/camera_control.grpc.pb.h"
#include "tests/support/daemon_process.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using test::DaemonProcess;
using ::testing::HasSubstr;

v1::OpenSession two_capsules() {
  v1::OpenSession open;
  for (uint64_t id = 1; id <= 2; ++id) {
    v1::NewInstance* instance = open.add_instances();
    instance->set_id(id);
    instance->mutable_shape()->mutable_capsule()->set_radius(0.3);
    instance->mutable_shape()->mutable_capsule()->set_half_height(0.6);
    instance->mutable_pose()->mutable_position()->set_x(static_cast<double>(id));
    open.add_targets()->set_id(id);
  }
  open.mutable_camera()->mutable_position()->set_z(6);
  return open;
}

v1::Tick tick(uint64_t sequence) {
  v1::Tick message;
  message.set_sequence(sequence);
  message.set_time_s(static_cast<double>(sequence) / 60.0);
  return message;
}

// The next event, which must be a reply.
v1::CameraReply next_reply(ClientSession& session) {
  const auto event = session.receive(10s);
  if (!event || !*event || !std::holds_alternative<v1::CameraReply>(**event)) {
    ADD_FAILURE() << "no reply";
    return {};
  }
  return std::get<v1::CameraReply>(**event);
}

class ClientTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { daemon_ = std::make_unique<DaemonProcess>(); }
  static void TearDownTestSuite() { daemon_.reset(); }

  Client connect() { return std::move(*Client::connect(daemon_->address(), 10s)); }
  std::unique_ptr<ClientSession> open(Client& client, const v1::OpenSession& request = two_capsules()) {
    auto session = client.open_session(request, 10s);
    EXPECT_TRUE(session) << to_string(session.error());
    return session ? std::move(*session) : nullptr;
  }

  static std::unique_ptr<DaemonProcess> daemon_;
};
std::unique_ptr<DaemonProcess> ClientTest::daemon_;

TEST_F(ClientTest, NobodyThereIsAnErrorThatNamesTheAddress) {
  const auto client = Client::connect("127.0.0.1:1", 200ms);
  ASSERT_FALSE(client);
  EXPECT_EQ(client.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(client.error().field, "address");
  EXPECT_THAT(client.error().message, HasSubstr("127.0.0.1:1"));
}

TEST_F(ClientTest, ASessionAnswersEveryTickInOrder) {
  Client client = connect();
  const auto session = open(client);
  EXPECT_FALSE(session->opened().session_id().empty());
  EXPECT_EQ(session->opened().instance_count(), 2u);
  for (uint64_t sequence = 1; sequence <= 20; ++sequence) {
    ASSERT_TRUE(session->send(tick(sequence)));
    EXPECT_EQ(next_reply(*session).sequence(), sequence);
  }
  EXPECT_TRUE(session->close(10s));
}

TEST_F(ClientTest, TicksSentInABurstAreAllCoveredByTheLastAnswer) {
  Client client = connect();
  const auto session = open(client);
  constexpr uint64_t kTicks = 100;
  for (uint64_t sequence = 1; sequence <= kTicks; ++sequence) ASSERT_TRUE(session->send(tick(sequence)));
  uint64_t covered = 0, last = 0;
  while (last < kTicks) {
    const v1::CameraReply reply = next_reply(*session);
    ASSERT_GT(reply.sequence(), last);
    last = reply.sequence();
    covered += 1 + reply.merged_ticks();
  }
  EXPECT_EQ(covered, kTicks);
}

TEST_F(ClientTest, ReceiveGivesUpAtItsDeadline) {
  Client client = connect();
  const auto session = open(client);
  const auto event = session->receive(20ms);
  ASSERT_TRUE(event);
  EXPECT_FALSE(event->has_value());
}

TEST_F(ClientTest, AWrongOpenRequestNamesItsField) {
  Client client = connect();
  v1::OpenSession request = two_capsules();
  request.mutable_targets(1)->set_weight(-1);
  const auto session = client.open_session(request, 10s);
  ASSERT_FALSE(session);
  EXPECT_EQ(session.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(session.error().field, HasSubstr("targets[1].weight"));
  EXPECT_FALSE(session.error().message.empty());
}

TEST_F(ClientTest, ARefusedTickIsAnEventAndTheSessionLivesOn) {
  Client client = connect();
  const auto session = open(client);
  v1::Tick wrong = tick(1);
  wrong.mutable_transforms()->add_ids(99);
  for (int k = 0; k < 3; ++k) wrong.mutable_transforms()->add_positions(0);
  ASSERT_TRUE(session->send(wrong));
  const auto event = session->receive(10s);
  ASSERT_TRUE(event && *event && std::holds_alternative<v1::TickError>(**event));
  const Error error = to_error(std::get<v1::TickError>(**event));
  EXPECT_EQ(error.code, ErrorCode::kNotFound);
  EXPECT_THAT(error.field, HasSubstr("transforms.ids[0]"));
  ASSERT_TRUE(session->send(tick(2)));
  EXPECT_EQ(next_reply(*session).sequence(), 2u);
}

tuning::v1alpha1::Tuning with_resolution(uint32_t texels) {
  tuning::v1alpha1::Tuning tuning;
  tuning.mutable_sample()->set_resolution(texels);
  return tuning;
}

TEST_F(ClientTest, ChangesGoWithTheNextTickInTheirOrderAndStay) {
  Client client = connect();
  v1::OpenSession request = two_capsules();
  request.mutable_diagnostics()->set_depth_maps(true);
  const auto session = open(client, request);
  v1::Settings paper, zoom;
  paper.set_preset(v1::Settings::PRESET_PAPER);
  zoom.set_min_vertical_fov_rad(1.0), zoom.set_max_vertical_fov_rad(1.0);
  session->change(with_resolution(9)), session->change(zoom);  // overwritten: the preset resets all settings
  session->change(paper), session->change(with_resolution(12)), session->change(with_resolution(13));
  v1::Tick first = tick(1);
  first.mutable_tuning()->mutable_sample()->set_resolution(14);
  for (uint64_t sequence = 1; sequence <= 2; ++sequence) {
    ASSERT_TRUE(session->send(sequence == 1 ? first : tick(sequence)));
    const v1::CameraReply reply = next_reply(*session);
    EXPECT_EQ(reply.volume_used(), v1::VOLUME_USED_PAIR) << "the preset asks for it";
    EXPECT_EQ(reply.depth_maps(0).width(), 14u) << sequence;
    EXPECT_NEAR(reply.field_of_view(), std::numbers::pi * 40 / 180, 1e-9) << sequence;
  }
  session->change(with_resolution(15));
  ASSERT_TRUE(session->send(tick(3)));
  EXPECT_EQ(next_reply(*session).depth_maps(0).width(), 15u);
}

TEST_F(ClientTest, AChangedLimitIsKept) {
  Client client = connect();
  const auto session = open(client);
  v1::CameraLimits limits, more;
  limits.set_max_speed_mps(0.05), more.set_max_acceleration_mps2(1.0);
  session->change(limits), session->change(more);
  double fastest = 0;
  for (uint64_t i = 1; i <= 60; ++i) {
    v1::Tick message = tick(i);  // both walk away, at 2 m/s
    for (const uint64_t id : {1, 2}) {
      message.mutable_transforms()->add_ids(id);
      for (const double p : {static_cast<double>(id) + 2.0 / 60 * i, 0.0, 0.0})
        message.mutable_transforms()->add_positions(p);
    }
    ASSERT_TRUE(session->send(message));
    const v1::Vec3 v = next_reply(*session).velocity();
    fastest = std::max(fastest, std::hypot(v.x(), v.y(), v.z()));
  }
  EXPECT_GT(fastest, 0.04);
  EXPECT_LE(fastest, 0.05 + 1e-9);
}

TEST_F(ClientTest, ARefusedChangeIsNamedAndGoneAndTheSessionLivesOn) {
  Client client = connect();
  v1::OpenSession request = two_capsules();
  request.mutable_diagnostics()->set_depth_maps(true);
  const auto session = open(client, request);
  session->change(with_resolution(1));
  ASSERT_TRUE(session->send(tick(1)));
  const auto event = session->receive(10s);
  ASSERT_TRUE(event && *event && std::holds_alternative<v1::TickError>(**event));
  EXPECT_EQ(to_error(std::get<v1::TickError>(**event)).field, "tick.tuning.sample.resolution");
  ASSERT_TRUE(session->send(tick(2)));
  EXPECT_EQ(next_reply(*session).depth_maps(0).width(), 7u);
}

TEST_F(ClientTest, AHandlerGetsTheEventsAndTheEnd) {
  Client client = connect();
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<uint64_t> sequences;
  int ends = 0;
  auto session = client.open_session(two_capsules(), 10s, [&](const Result<SessionEvent>& event) {
    const std::lock_guard lock(mutex);
    if (!event)
      ++ends;
    else
      sequences.push_back(std::get<v1::CameraReply>(*event).sequence());
    changed.notify_all();
  });
  ASSERT_TRUE(session) << to_string(session.error());
  for (uint64_t sequence = 1; sequence <= 3; ++sequence) {
    ASSERT_TRUE((*session)->send(tick(sequence)));
    std::unique_lock lock(mutex);
    ASSERT_TRUE(changed.wait_for(lock, 10s, [&] { return sequences.size() == sequence; }));
  }
  EXPECT_TRUE((*session)->close(10s));
  EXPECT_EQ(sequences, (std::vector<uint64_t>{1, 2, 3}));
  EXPECT_EQ(ends, 1);
}

TEST_F(ClientTest, AfterCloseNothingIsSentAndReceiveSaysWhy) {
  Client client = connect();
  const auto session = open(client);
  ASSERT_TRUE(session->close(10s));
  const Status sent = session->send(tick(1));
  ASSERT_FALSE(sent);
  EXPECT_EQ(sent.error().field, "session");
  const auto event = session->receive(10s);
  ASSERT_FALSE(event);
  EXPECT_EQ(event.error().code, ErrorCode::kUnavailable);
}

TEST_F(ClientTest, ASessionOutlivesItsClientAndMayBeDroppedWhileOpen) {
  std::unique_ptr<ClientSession> session;
  {
    Client client = connect();
    session = open(client);
  }
  ASSERT_TRUE(session->send(tick(1)));
  EXPECT_EQ(next_reply(*session).sequence(), 1u);
  ASSERT_TRUE(session->send(tick(2)));
  session.reset();
}

TEST_F(ClientTest, UnreadAnswersAreBoundedAndTheNewestAreKept) {
  Client client = connect();
  const auto session = open(client);
  // Sends one tick at a time, so that few are merged. On a busy machine many are, so it goes on until something is
  // dropped.
  size_t ticks = 0;
  while (ticks < ClientSession::kMaxUnread + 40 ||
         (session->dropped_events() == 0 && ticks < 10 * ClientSession::kMaxUnread)) {
    ASSERT_TRUE(session->send(tick(++ticks)));
    std::this_thread::sleep_for(3ms);
  }
  // A reply that arrives while the others are read finds room, so all have to be here. While replies arrive, events are
  // dropped.
  for (size_t dropped = SIZE_MAX; dropped != session->dropped_events();) {
    dropped = session->dropped_events();
    std::this_thread::sleep_for(1s);
  }
  EXPECT_GT(session->dropped_events(), 0u);
  uint64_t last = 0;
  size_t read = 0;
  while (last < ticks) {
    const v1::CameraReply reply = next_reply(*session);
    if (HasFailure()) return;
    last = reply.sequence();
    ++read;
  }
  EXPECT_LE(read, ClientSession::kMaxUnread);
  EXPECT_EQ(last, ticks);
}

TEST_F(ClientTest, AnUploadedSceneOpensASession) {
  scenes::GlbWriter writer;
  const int box = writer.add_mesh("box", *tessellate(BoxShape{}), {1, 1, 1});
  writer.add_node({"anna", -1, box, -1, {0, 0, 0}, {1, 0, 0, 0}, nullptr});
  writer.add_node({"wall", -1, box, -1, {5, 0, 0}, {1, 0, 0, 0}, nullptr});
  Client client = connect();
  const auto scene = client.upload_scene(writer.finish("none"), 10s);
  ASSERT_TRUE(scene) << to_string(scene.error());
  EXPECT_EQ(scene->hash().size(), 32u);
  EXPECT_EQ(scene->triangle_count(), 24u);
  v1::OpenSession request;
  request.mutable_scene()->set_hash(scene->hash());
  v1::NodeBinding* binding = request.mutable_scene()->add_bindings();
  binding->set_node("anna");
  binding->set_id(1);
  request.add_targets()->set_id(1);
  request.mutable_camera()->mutable_position()->set_z(6);
  const auto session = open(client, request);
  ASSERT_TRUE(session);
  EXPECT_EQ(session->opened().instance_count(), 2u);
  EXPECT_EQ(session->opened().triangle_count(), 24u);
}

// A scene that goes in several pieces comes whole.
TEST_F(ClientTest, ALargeSceneIsUploadedByteForByte) {
  MeshData grid;
  constexpr uint32_t kSide = 260;
  for (uint32_t i = 0; i < kSide * kSide; ++i)
    grid.positions.emplace_back(i % kSide, 0.01f * static_cast<float>(i % 7), i / kSide);
  for (uint32_t i = 0; i + kSide < kSide * kSide; ++i)
    if (i % kSide + 1 < kSide) grid.indices.insert(grid.indices.end(), {i, i + kSide, i + 1});
  scenes::GlbWriter writer;
  writer.add_node({"grid", -1, writer.add_mesh("grid", grid, {1, 1, 1}), -1, {0, 0, 0}, {1, 0, 0, 0}, nullptr});
  const std::vector<std::byte> file = writer.finish("none");
  ASSERT_GT(file.size(), size_t{1} << 20);
  GeometryStore store;
  const auto asset = read_gltf(file, nullptr, store);
  ASSERT_TRUE(asset) << to_string(asset.error());
  Client client = connect();
  const auto scene = client.upload_scene(file, 10s);
  ASSERT_TRUE(scene) << to_string(scene.error());
  EXPECT_EQ(scene->hash(), to_hex((*asset)->hash));
  EXPECT_EQ(scene->triangle_count(), grid.indices.size() / 3);
}

TEST_F(ClientTest, AnUploadThatIsNoSceneIsAnError) {
  Client client = connect();
  const std::vector<std::byte> noise(3'000'000, std::byte{0x5a});
  const auto scene = client.upload_scene(noise, 10s);
  ASSERT_FALSE(scene);
  EXPECT_FALSE(scene.error().message.empty());
  EXPECT_TRUE(client.server_info(10s)) << "the connection still stands";
}

TEST_F(ClientTest, TheServerSaysWhatItIs) {
  Client client = connect();
  const auto info = client.server_info(10s);
  ASSERT_TRUE(info) << to_string(info.error());
  EXPECT_EQ(info->sampler(), "embree");
  const auto stats = client.server_stats(10s);
  ASSERT_TRUE(stats) << to_string(stats.error());
  EXPECT_FALSE(stats->has_recording());
  EXPECT_TRUE(client.list_scenes(10s));
}

TEST(ClientAndDaemon, AServerThatStopsSaysSoAndAClosedSessionLetsItGo) {
  DaemonProcess daemon;
  auto client = Client::connect(daemon.address(), 10s);
  ASSERT_TRUE(client);
  auto session = client->open_session(two_capsules(), 10s);
  ASSERT_TRUE(session) << to_string(session.error());
  daemon.ask_to_stop();
  const auto event = (*session)->receive(10s);
  ASSERT_TRUE(event && *event) << "nothing was said";
  EXPECT_TRUE(std::holds_alternative<v1::Drain>(**event));
  (*session)->close(10s);
  EXPECT_EQ(daemon.stop(), 0);
  EXPECT_FALSE((*session)->receive(10s)) << "the stream has ended";
}

TEST(ClientAndDaemon, AServerThatDiesEndsTheSessionWithAnError) {
  DaemonProcess daemon;
  auto client = Client::connect(daemon.address(), 10s);
  ASSERT_TRUE(client);
  auto session = client->open_session(two_capsules(), 10s);
  ASSERT_TRUE(session) << to_string(session.error());
  daemon.kill_now();
  const auto event = (*session)->receive(10s);
  ASSERT_FALSE(event);
  EXPECT_EQ(event.error().code, ErrorCode::kUnavailable);
  EXPECT_FALSE((*session)->send(tick(1)));
}

TEST(ClientAndDaemon, AServerThatHangsEndsTheSessionWithAnError) {
  DaemonProcess daemon;
  auto client = Client::connect(daemon.address(), 10s, {.time = 1s, .timeout = 500ms});
  ASSERT_TRUE(client);
  auto session = client->open_session(two_capsules(), 10s);
  ASSERT_TRUE(session) << to_string(session.error());
  daemon.hold();
  const auto event = (*session)->receive(20s);
  daemon.go_on();
  ASSERT_FALSE(event);
  EXPECT_EQ(event.error().code, ErrorCode::kUnavailable);
}

TEST(ClientAndDaemon, AGameThatPausesKeepsItsSession) {
  DaemonProcess daemon;
  auto client = Client::connect(daemon.address(), 10s, {.time = 1100ms, .timeout = 1s});
  ASSERT_TRUE(client);
  auto session = client->open_session(two_capsules(), 10s);
  ASSERT_TRUE(session) << to_string(session.error());
  // At most four pings without data between them.
  const auto nothing = (*session)->receive(5s);
  ASSERT_TRUE(nothing) << to_string(nothing.error());
  EXPECT_FALSE(*nothing);
  ASSERT_TRUE((*session)->send(tick(1)));
  EXPECT_EQ(next_reply(**session).sequence(), 1u);
}

TEST(ClientAndDaemon, AllPagesOfTheListOfScenesAreRead) {
  constexpr int kScenes = 1001;  // one more than a page holds
  const test::TemporaryFolder folder;
  for (int k = 0; k < kScenes; ++k) std::ofstream(folder / (std::to_string(k) + ".glb"));
  DaemonProcess daemon({"--sampler", "embree", "--scene-dir", folder.path()});
  auto client = Client::connect(daemon.address(), 10s);
  ASSERT_TRUE(client) << to_string(client.error());
  const auto names = client->list_scenes(10s);
  ASSERT_TRUE(names) << to_string(names.error());
  EXPECT_EQ(std::set<std::string>(names->begin(), names->end()).size(), size_t{kScenes});
  EXPECT_EQ(names->size(), size_t{kScenes});
}

// Three pages, of which the second is empty. A daemon would need a thousand sessions for a second page.
class PagedService final : public v1::CameraControlService::Service {
  grpc::Status ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest* request,
                            v1::ListSessionsResponse* response) override {
    const std::string& token = request->page_token();
    if (token != "two") response->add_sessions()->set_session_id(token.empty() ? "first" : "last");
    if (token != "three") response->set_next_page_token(token.empty() ? "two" : "three");
    return grpc::Status::OK;
  }
};

TEST(Client, ReadsAllPagesOfTheListOfSessions) {
  PagedService service;
  int port = 0;
  const auto server = grpc::ServerBuilder()
                          .AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port)
                          .RegisterService(&service)
                          .BuildAndStart();
  ASSERT_NE(server, nullptr);
  auto client = Client::connect("127.0.0.1:" + std::to_string(port), 10s);
  ASSERT_TRUE(client) << to_string(client.error());
  const auto sessions = client->list_sessions(10s);
  ASSERT_TRUE(sessions) << to_string(sessions.error());
  ASSERT_EQ(sessions->size(), 2u);
  EXPECT_EQ((*sessions)[0].session_id(), "first");
  EXPECT_EQ((*sessions)[1].session_id(), "last");
}

TEST(ClientAndDaemon, ATokenIsShownOverASocketAndNeverInTheClear) {
  const test::TemporaryFolder folder;
  const std::string token = "0123456789abcdef", access = folder / "access", socket = folder / "sightline.sock";
  std::ofstream(access) << "token game control " << token << '\n';
  std::filesystem::permissions(access, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  DaemonProcess daemon({"--sampler", "embree", "--access-file", access, "--listen", "none", "--listen-unix", socket});
  ClientCredentials game;
  game.token = token;
  auto known = Client::connect("unix:" + socket, 10s, {}, game);
  ASSERT_TRUE(known) << to_string(known.error());
  EXPECT_TRUE(known->server_info(10s));
  const auto session = known->open_session(two_capsules(), 10s);
  EXPECT_TRUE(session) << to_string(session.error());
  auto stranger = Client::connect("unix:" + socket, 10s);
  ASSERT_TRUE(stranger) << to_string(stranger.error());
  const auto refused = stranger->open_session(two_capsules(), 10s);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().field, "credentials");
  const auto unsafe = Client::connect("127.0.0.1:1", 10s, {}, game);
  ASSERT_FALSE(unsafe);
  EXPECT_EQ(unsafe.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(unsafe.error().field, "token");
}

TEST(ClientAndDaemon, AUnixSocketWorksAsWell) {
  const test::TemporaryFolder folder;
  const std::string socket = folder / "sightline.sock";
  DaemonProcess daemon({"--sampler", "embree", "--listen-unix", socket});
  auto client = Client::connect("unix:" + socket, 10s);
  ASSERT_TRUE(client) << to_string(client.error());
  EXPECT_TRUE(client->server_info(10s));
}

}  // namespace
}  // namespace sightline
