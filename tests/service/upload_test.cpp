// Scenes by upload and by name.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <future>
#include <thread>

#include "tests/service/service_world.h"
#include "tests/support/glb_builder.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

std::vector<std::byte> triangle_file() {
  GlbBuilder builder;
  builder.triangle_node();
  return builder.glb();
}

// One upload call.
class Upload {
 public:
  explicit Upload(const std::shared_ptr<grpc::Channel>& channel) : stub_(v1::CameraControlService::NewStub(channel)) {
    context_.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
    call_ = stub_->UploadScene(&context_, &reply_);
  }
  bool send(std::span<const std::byte> chunk) {
    v1::UploadSceneRequest request;
    request.set_chunk(chunk.data(), chunk.size());
    return call_->Write(request);
  }
  grpc::Status finish() {
    call_->WritesDone();
    return call_->Finish();
  }
  // Neither sends more nor ends the upload.
  grpc::Status wait_for_end() { return call_->Finish(); }
  void cancel() { context_.TryCancel(); }
  const v1::UploadSceneResponse& reply() const { return reply_; }

 private:
  const std::unique_ptr<v1::CameraControlService::Stub> stub_;
  grpc::ClientContext context_;
  v1::UploadSceneResponse reply_;
  std::unique_ptr<grpc::ClientWriter<v1::UploadSceneRequest>> call_;
};

grpc::Status upload(const ServiceWorld& world, std::span<const std::byte> bytes,
                    v1::UploadSceneResponse* reply = nullptr, size_t chunk_bytes = 100) {
  Upload call(world.channel());
  for (size_t at = 0; at < bytes.size(); at += chunk_bytes) {
    if (!call.send(bytes.subspan(at, std::min(chunk_bytes, bytes.size() - at)))) break;
  }
  const grpc::Status status = call.finish();
  if (reply) *reply = call.reply();
  return status;
}

TEST(UploadScene, ASessionOpensWithTheHashThatAnUploadAnswered) {
  const ServiceWorld world;
  v1::UploadSceneResponse reply;
  const grpc::Status status = upload(world, triangle_file(), &reply);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(reply.hash().size(), 32u);
  EXPECT_EQ(reply.triangle_count(), 1u);

  v1::OpenSession open = open_with_boxes(1);
  open.mutable_scene()->set_hash(reply.hash());
  Stream stream(world.channel());
  EXPECT_EQ(stream.open(open).instance_count(), 2u);
}

TEST(UploadScene, AHashThatNobodyUploadedIsNotFound) {
  const ServiceWorld world;
  v1::OpenSession open = open_with_boxes(1);
  open.mutable_scene()->set_hash(std::string(32, '0'));
  Stream stream(world.channel());
  stream.send(open);
  const grpc::Status status = stream.finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(fields_of(status), std::vector<std::string>{"open.scene.hash"});
}

TEST(UploadScene, EveryTruncationIsRefusedAndTheServerLives) {
  const ServiceWorld world;
  const std::vector<std::byte> file = triangle_file();
  for (size_t length = 0; length < file.size(); length += 7) {
    EXPECT_EQ(upload(world, std::span(file).first(length)).error_code(), grpc::StatusCode::INVALID_ARGUMENT) << length;
  }
  EXPECT_TRUE(upload(world, file).ok());
  EXPECT_EQ(world.stats().geometry_count(), 1u);
}

TEST(UploadScene, AFileThatRefersToOthersIsRefused) {
  const ServiceWorld world;
  GlbBuilder builder;
  builder.triangle_node();
  for (const char* uri : {"beside.bin", "../../etc/passwd", "/etc/passwd", "file:///etc/passwd"}) {
    EXPECT_FALSE(upload(world, builder.gltf(uri)).ok()) << uri;
  }
}

TEST(UploadScene, AFileWithAnImpossibleCountIsRefused) {
  const ServiceWorld world;
  GlbBuilder builder;
  builder.triangle_node();
  builder.json["accessors"][0]["count"] = 4'000'000'000u;
  EXPECT_EQ(upload(world, builder.glb()).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST(UploadScene, AFileOverTheLimitIsRefused) {
  const ServiceWorld world({.limits = {.max_upload_bytes = 1000}});
  const std::vector<std::byte> bytes(2000);
  const grpc::Status status = upload(world, bytes);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(fields_of(status), std::vector<std::string>{"chunk"});
}

TEST(UploadScene, AChunkOverTheLimitIsRefused) {
  const ServiceWorld world;
  const std::vector<std::byte> bytes((size_t{1} << 20) + 1);
  EXPECT_EQ(upload(world, bytes, nullptr, bytes.size()).error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
}

// The server may take the second upload first and end it before it takes the first one. Then both succeed, and the test
// tries again.
TEST(UploadScene, TooManyAtATimeAreToldToTryAgain) {
  const ServiceWorld world({.limits = {.max_uploads = 1}});
  grpc::Status refused;
  for (int i = 0; i < 1000 && refused.ok(); ++i) {
    Upload first(world.channel());
    first.send(triangle_file());
    refused = upload(world, triangle_file());
    const grpc::Status status = first.finish();
    EXPECT_TRUE(status.ok() || refused.ok()) << status.error_message();
  }
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_GT(retry_seconds_of(refused), 0);
}

TEST(UploadScene, ACancelledUploadGivesItsPlaceBack) {
  const ServiceWorld world({.limits = {.max_uploads = 1}});
  Upload first(world.channel());
  first.send(triangle_file());
  first.cancel();
  EXPECT_EQ(first.finish().error_code(), grpc::StatusCode::CANCELLED);
  grpc::Status status(grpc::StatusCode::UNKNOWN, "");
  for (int i = 0; i < 1000 && !status.ok(); ++i) status = upload(world, triangle_file());
  EXPECT_TRUE(status.ok()) << status.error_message();
}

// A client that keeps sending is not cut off, however long it takes.
TEST(UploadScene, ASilentOneGivesItsPlaceBackAndASlowOneDoesNot) {
  constexpr std::chrono::milliseconds kTimeout(2500);
  const ServiceWorld world({.limits = {.max_uploads = 1, .upload_timeout = kTimeout}});
  const std::vector<std::byte> file = triangle_file();
  {
    Upload slow(world.channel());
    const size_t part = file.size() / 5 + 1;
    for (size_t at = 0; at < file.size(); at += part) {
      ASSERT_TRUE(slow.send(std::span(file).subspan(at, std::min(part, file.size() - at))));
      std::this_thread::sleep_for(kTimeout / 4);
    }
    EXPECT_TRUE(slow.finish().ok());
  }
  Upload silent(world.channel());
  ASSERT_TRUE(silent.send(std::span(file).first(10)));
  EXPECT_EQ(silent.wait_for_end().error_code(), grpc::StatusCode::CANCELLED);
  grpc::Status status(grpc::StatusCode::UNKNOWN, "");
  for (int i = 0; i < 1000 && !status.ok(); ++i) status = upload(world, file);
  EXPECT_TRUE(status.ok()) << status.error_message();
}

TEST(ListScenes, NamesWhatTheFolderHolds) {
  const test::TemporaryFolder folder;
  std::filesystem::create_directories(folder / "levels");
  const std::vector<std::byte> file = triangle_file();
  for (const char* name : {"b.glb", "a.glb", "levels/one.glb", "notes.txt"}) {
    std::ofstream(folder / name)
        .write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
  }
  const ServiceWorld world({.scene_dir = folder.path()});
  grpc::ClientContext context;
  v1::ListScenesResponse reply;
  ASSERT_TRUE(v1::CameraControlService::NewStub(world.channel())->ListScenes(&context, {}, &reply).ok());
  EXPECT_THAT(reply.names(), testing::ElementsAre("a.glb", "b.glb", "levels/one.glb"));

  v1::OpenSession open = open_with_boxes(1);
  open.mutable_scene()->set_name("levels/one.glb");
  Stream stream(world.channel());
  EXPECT_EQ(stream.open(open).instance_count(), 2u);
}

TEST(ListScenes, ComesInPages) {
  const test::TemporaryFolder folder;
  for (const char* name : {"a.glb", "b.glb", "c.glb", "d.glb", "e.glb"}) std::ofstream(folder / name) << "x";
  const ServiceWorld world({.scene_dir = folder.path()});
  const auto stub = v1::CameraControlService::NewStub(world.channel());
  std::vector<std::vector<std::string>> pages;
  v1::ListScenesRequest request;
  request.set_page_size(2);
  do {
    grpc::ClientContext context;
    v1::ListScenesResponse response;
    ASSERT_TRUE(stub->ListScenes(&context, request, &response).ok());
    pages.emplace_back(response.names().begin(), response.names().end());
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty() && pages.size() < 9);
  using Page = std::vector<std::string>;
  EXPECT_THAT(pages, testing::ElementsAre(Page{"a.glb", "b.glb"}, Page{"c.glb", "d.glb"}, Page{"e.glb"}));

  grpc::ClientContext context;
  v1::ListScenesResponse response;
  request.set_page_size(1001);
  const grpc::Status refused = stub->ListScenes(&context, request, &response);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(fields_of(refused), testing::ElementsAre("page_size"));
}

TEST(ListScenes, IsEmptyWithoutAFolder) {
  const ServiceWorld world;
  grpc::ClientContext context;
  v1::ListScenesResponse reply;
  ASSERT_TRUE(v1::CameraControlService::NewStub(world.channel())->ListScenes(&context, {}, &reply).ok());
  EXPECT_EQ(reply.names_size(), 0);
}

TEST(Uploads, NoOpeningWaitsForAFileToBeRead) {
  ServiceWorld world;
  std::future<grpc::Status> uploaded;
  {
    const HeldLoaders held(world.uploaders);
    uploaded = std::async(std::launch::async, [&] { return upload(world, triangle_file()); });
    Stream stream(world.channel());
    stream.open(open_with_boxes(2));
    stream.send(move_tick(1, 1, 0.1));
    EXPECT_TRUE(stream.read()->has_camera());
    EXPECT_EQ(uploaded.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  }
  EXPECT_TRUE(uploaded.get().ok());
}

TEST(Uploads, AFileWhoseClientIsGoneIsNotRead) {
  ServiceWorld world;
  {
    const HeldLoaders held(world.uploaders);
    Upload call(world.channel());
    GlbBuilder other;
    other.triangle_node();
    other.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = other.floats({0, 0, 0, 2, 0, 0, 0, 2, 0});
    EXPECT_TRUE(call.send(other.glb()));
    std::thread gone([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      call.cancel();
    });
    EXPECT_EQ(call.finish().error_code(), grpc::StatusCode::CANCELLED);
    gone.join();
    std::this_thread::sleep_for(std::chrono::milliseconds(100));  // the server hears of it too
  }
  EXPECT_TRUE(upload(world, triangle_file()).ok());  // the uploaders have worked through what came before
  EXPECT_EQ(world.geometry_count(), 1u);
}

}  // namespace
}  // namespace sightline
