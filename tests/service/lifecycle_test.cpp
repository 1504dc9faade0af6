// Health, reflection, peers that vanish, and the orderly stop, in one process.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <thread>

#include "grpc/health/v1/health.grpc.pb.h"
#include "tests/service/raw_call.h"
#include "tests/service/service_world.h"

namespace sightline {
namespace {

const char* const kService = "sightline.v1.CameraControlService";

TEST(Lifecycle, HealthServesFromTheStartAndNotWhileDraining) {
  const ServiceWorld world;
  for (const char* service : {"", kService}) EXPECT_EQ(health_of(world.channel(), service), 1) << service;
  EXPECT_EQ(health_of(world.channel(), "no.such.Service"), -1);
  world.listener->set_serving(false);
  for (const char* service : {"", kService}) EXPECT_EQ(health_of(world.channel(), service), 2) << service;
}

// A client that watches the health of one service.
class HealthWatch {
 public:
  HealthWatch(const ServiceWorld& world, const std::string& service)
      : stub_(grpc::health::v1::Health::NewStub(world.channel())) {
    context_.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
    grpc::health::v1::HealthCheckRequest request;
    request.set_service(service);
    reader_ = stub_->Watch(&context_, request);
  }
  // The next status that the server sends; -1 when the call has ended.
  int next() {
    grpc::health::v1::HealthCheckResponse response;
    return reader_->Read(&response) ? response.status() : -1;
  }
  grpc::StatusCode end() { return reader_->Finish().error_code(); }
  void cancel() { context_.TryCancel(); }

 private:
  const std::unique_ptr<grpc::health::v1::Health::Stub> stub_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<grpc::health::v1::HealthCheckResponse>> reader_;
};

TEST(Lifecycle, HealthIsSentToItsWatchers) {
  const ServiceWorld world;
  HealthWatch server(world, ""), service(world, kService), unknown(world, "no.such.Service");
  HealthWatch gone(world, kService);
  EXPECT_EQ(server.next(), 1);
  EXPECT_EQ(service.next(), 1);
  EXPECT_EQ(unknown.next(), 3);  // SERVICE_UNKNOWN: the service may be added later
  EXPECT_EQ(gone.next(), 1);
  gone.cancel();
  EXPECT_EQ(gone.next(), -1);

  world.listener->set_serving(false);
  EXPECT_EQ(server.next(), 2);
  EXPECT_EQ(service.next(), 2);

  // Watch calls must not delay the stop, which would otherwise wait for this long.
  world.listener->stop(std::chrono::hours(1));
  EXPECT_EQ(server.next(), -1);
  EXPECT_EQ(unknown.next(), -1);
  EXPECT_EQ(server.end(), grpc::StatusCode::CANCELLED);
}

class Reflection : public testing::TestWithParam<const char*> {
 protected:
  // The bytes of a ServerReflectionResponse. `request` holds a ServerReflectionRequest's bytes.
  std::string ask(const std::string& request) const {
    const RawReply reply = call_raw(
        world.channel(), std::string("/grpc.reflection.") + GetParam() + ".ServerReflection/ServerReflectionInfo",
        request);
    EXPECT_TRUE(reply.status.ok()) << reply.status.error_message();
    return reply.bytes;
  }
  // Field 4 (file_containing_symbol), a string.
  std::string file_with(const std::string& symbol) const {
    return ask(std::string("\x22") + static_cast<char>(symbol.size()) + symbol);
  }
  const ServiceWorld world;
};
INSTANTIATE_TEST_SUITE_P(Lifecycle, Reflection, testing::Values("v1", "v1alpha"),
                         [](const auto& test) { return test.param; });

TEST_P(Reflection, ListsTheServices) {
  const std::string listed = ask(std::string("\x3a\x01*", 3));  // field 7 (list_services), a string
  for (const char* service : {kService, "grpc.health.v1.Health", "grpc.reflection.v1.ServerReflection",
                              "grpc.reflection.v1alpha.ServerReflection"})
    EXPECT_NE(listed.find(service), std::string::npos) << service;
}

TEST_P(Reflection, GivesTheFilesOfTheServiceAndOfTheDetailsOfErrors) {
  EXPECT_NE(file_with(kService).find("sightline/v1/camera_control.proto"), std::string::npos);
  // grpcurl prints the details of an error by these.
  for (const char* type : {"google.rpc.BadRequest", "google.rpc.RetryInfo"})
    EXPECT_NE(file_with(type).find("google/rpc/error_details.proto"), std::string::npos) << type;
}

TEST_P(Reflection, SaysThatASymbolDoesNotExist) {
  EXPECT_NE(file_with("no.such.Type").find("there is no such file or symbol"), std::string::npos);
}

TEST(Lifecycle, DrainNotifiesOpenStreamsAnswersTheirTicksAndRefusesNewOnes) {
  ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(2));
  world.device.close_gate();
  stream.send(move_tick(1, 1, 0.1));
  world.device.wait_until_held(1);
  stream.send(move_tick(2, 1, 0.2));
  world.streams.drain("maintenance");

  Stream late(world.channel());
  EXPECT_EQ(late.finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  world.device.open_gate();

  bool told = false;
  uint64_t newest = 0;
  stream.half_close();
  while (const auto reply = stream.read()) {
    if (reply->has_drain()) told = reply->drain().reason() == "maintenance";
    if (reply->has_camera()) newest = reply->camera().sequence();
  }
  EXPECT_TRUE(told);
  EXPECT_EQ(newest, 2u);
  EXPECT_TRUE(stream.finish().ok());
}

TEST(Lifecycle, AStreamHearsOfADrainEvenBeforeItOpens) {
  ServiceWorld world;
  Stream stream(world.channel());
  while (world.streams.size() == 0) std::this_thread::yield();
  world.streams.drain("maintenance");
  const auto reply = stream.read();
  ASSERT_TRUE(reply);
  EXPECT_TRUE(reply->has_drain());
}

// Nothing else happens on the stream that would send what waits.
TEST(Lifecycle, AnIdleStreamHearsOfADrain) {
  ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(2));
  stream.send(move_tick(1, 1, 0.1));
  ASSERT_TRUE(stream.read()->has_camera());
  world.streams.drain("maintenance");
  const auto reply = stream.read();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->drain().reason(), "maintenance");
}

TEST(Lifecycle, AnEndedStreamClosesWithTheStatus) {
  ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(2));
  world.streams.end_all({grpc::StatusCode::UNAVAILABLE, "the server stopped"});
  const grpc::Status status = stream.finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(status.error_message(), "the server stopped");
}

TEST(Lifecycle, AStopCancelsWhatDoesNotEnd) {
  ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(2));
  world.listener->stop(std::chrono::milliseconds(50));
  EXPECT_FALSE(stream.finish().ok());
  EXPECT_EQ(world.streams.size(), 0u);
}

// A peer that speaks HTTP/2 well enough to be a client and then answers nothing, not even pings.
TEST(Lifecycle, APeerThatFallsSilentIsDisconnected) {
  const ServiceWorld world(
      {.keepalive_time = std::chrono::milliseconds(200), .keepalive_timeout = std::chrono::milliseconds(200)});
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(world.listener->port()));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  const std::string hello("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0",
                          33);  // preface, empty SETTINGS
  ASSERT_EQ(::send(fd, hello.data(), hello.size(), 0), static_cast<ssize_t>(hello.size()));
  const timeval timeout{30, 0};
  ::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof(timeout));
  char buffer[512];
  ssize_t got = 1;
  while (got > 0) got = ::recv(fd, buffer, sizeof(buffer), 0);
  EXPECT_TRUE(got == 0 || errno == ECONNRESET) << "the server kept the connection";
  ::close(fd);
}

TEST(Lifecycle, ServerInfoDescribesTheServer) {
  const ServiceWorld world({.max_sessions = 3});
  const v1::GetServerInfoResponse info = world.info();
  EXPECT_EQ(info.sampler(), "embree");
  EXPECT_FALSE(info.version().empty());
  EXPECT_FALSE(info.renderer().empty());
  EXPECT_EQ(info.max_sessions(), 3u);
  EXPECT_EQ(world.stats().open_sessions(), 0u);
}

}  // namespace
}  // namespace sightline
