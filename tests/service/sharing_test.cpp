// Geometry is stored once, however many sessions use it.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "scenes/city.h"
#include "tests/service/service_world.h"

namespace sightline {
namespace {

constexpr size_t kChunk = size_t{1} << 20;

v1::UploadSceneResponse upload_city(const ServiceWorld& world) {
  const std::vector<std::byte> city = scenes::make_city({});
  const auto stub = v1::CameraControlService::NewStub(world.channel());
  grpc::ClientContext context;
  v1::UploadSceneResponse reply;
  const auto call = stub->UploadScene(&context, &reply);
  for (size_t at = 0; at < city.size(); at += kChunk) {
    v1::UploadSceneRequest request;
    request.set_chunk(city.data() + at, std::min(kChunk, city.size() - at));
    call->Write(request);
  }
  call->WritesDone();
  const grpc::Status status = call->Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  return reply;
}

TEST(Sharing, TenSessionsOfTheCityUseTheGeometryMemoryOfOne) {
  const ServiceWorld world;
  const v1::UploadSceneResponse city = upload_city(world);
  EXPECT_GT(city.triangle_count(), 270'000u);

  std::vector<std::unique_ptr<Stream>> streams;
  const auto open_one_more = [&] {
    v1::OpenSession open = open_with_boxes(2);
    open.mutable_scene()->set_hash(city.hash());
    streams.push_back(std::make_unique<Stream>(world.channel()));
    EXPECT_GT(streams.back()->open(open).triangle_count(), 270'000u);
    streams.back()->send(move_tick(1, 1, 0.5));
    const auto reply = streams.back()->read();
    EXPECT_TRUE(reply && reply->has_camera());
  };
  open_one_more();
  const v1::GetServerStatsResponse one = world.stats();
  EXPECT_GT(one.geometry_bytes(), size_t{100} << 10);
  EXPECT_GT(one.cluster_bytes(), 0u);
  EXPECT_LT(one.cluster_bytes(), one.geometry_bytes() / 4);
  EXPECT_GT(one.sampler_bytes(), size_t{100} << 10);
  while (streams.size() < 10) open_one_more();
  const v1::GetServerStatsResponse ten = world.stats();
  EXPECT_EQ(ten.open_sessions(), 10u);
  EXPECT_EQ(ten.geometry_count(), one.geometry_count());
  EXPECT_EQ(ten.geometry_bytes(), one.geometry_bytes());
  EXPECT_EQ(ten.sampler_bytes(), one.sampler_bytes());
}

}  // namespace
}  // namespace sightline
