// Scene files are stored in the recording on request. The session can then be replayed without the scene folder.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/service/recorded_session.h"
#include "tests/support/glb_builder.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using test::Heard;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

using Bytes = std::vector<std::byte>;

// One mesh, named "panel": a triangle of this width.
GlbBuilder panel(float width_m) {
  GlbBuilder file;
  file.mesh_node({{"attributes", {{"POSITION", file.floats({0, 0, 0, width_m, 0, 0, 0, 2, 0})}}}});
  file.json["meshes"][0]["name"] = "panel";
  return file;
}

std::string text_of(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::string attached_as(const std::string& hash) {
  return std::string("upload/").append(hash);
}

void write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

void add_panel(v1::NewInstance& instance, uint64_t id, double z) {
  instance.set_id(id);
  instance.mutable_mesh()->set_mesh("panel");
  instance.mutable_pose()->mutable_position()->set_z(z);
}

// A daemon over a folder of scenes of every kind.
class RecordedScenes : public testing::Test {
 protected:
  RecordedScenes() {
    write(scenes_ / "room.glb", text_of(panel(3).glb()));
    const GlbBuilder parts = panel(1);
    write(scenes_ / "props/screen.gltf", text_of(parts.gltf("data/screen.bin")));
    write(scenes_ / "props/data/screen.bin", text_of({parts.binary().begin(), parts.binary().end()}));
    write(scenes_ / "late.glb", text_of(panel(2).glb()));
  }
  void start(std::vector<std::string> flags = {}) {
    flags.insert(flags.end(), {"--listen", "127.0.0.1:0", "--record-dir", folder_, "--scene-dir", scenes_});
    daemon_ = std::make_unique<Daemon>(flags);
    ASSERT_TRUE(daemon_->wait_until_ready()) << daemon_->errors();
  }
  std::string address() const { return daemon_->addresses().front(); }
  std::string upload(const Bytes& bytes) const {
    const auto stub = v1::CameraControlService::NewStub(connect(address()));
    grpc::ClientContext context;
    v1::UploadSceneResponse reply;
    const auto writer = stub->UploadScene(&context, &reply);
    v1::UploadSceneRequest request;
    request.set_chunk(text_of(bytes));
    writer->Write(request);
    writer->WritesDone();
    EXPECT_TRUE(writer->Finish().ok());
    return reply.hash();
  }
  // Names a scene in every field that can name one.
  Heard talk(const std::string& uploaded, bool ask) {
    v1::OpenSession open = open_with_boxes(2);
    open.mutable_recording()->set_attach_scenes(ask);
    open.mutable_scene()->set_name("room.glb");
    v1::NewInstance& screen = *open.add_instances();
    add_panel(screen, 10, 2);
    screen.mutable_mesh()->set_scene_name("props/screen.gltf");
    Heard heard(address(), open);
    EXPECT_EQ(heard.opened.warnings_size(), 0) << heard.opened.DebugString();
    for (uint64_t i = 1; i <= 12; ++i) {
      v1::Tick tick = move_tick(i, 1, 0.1 * static_cast<double>(i));
      if (i == 4) {
        add_panel(*tick.mutable_delta()->add_added_instances(), 11, 3);
        tick.mutable_delta()->mutable_added_instances(0)->mutable_mesh()->set_scene_name("late.glb");
      }
      if (i == 8) {
        add_panel(*tick.mutable_delta()->add_added_instances(), 12, 4);
        tick.mutable_delta()->mutable_added_instances(0)->mutable_mesh()->set_scene_hash(uploaded);
      }
      EXPECT_TRUE(heard.ask(tick));
    }
    EXPECT_EQ(heard.rejections.size(), 0u);
    EXPECT_TRUE(heard.finish().ok());
    return heard;
  }

  const test::TemporaryFolder scratch_;
  const std::string folder_ = scratch_ / "recordings";
  const fs::path scenes_ = scratch_ / "scenes";
  const fs::path elsewhere_ = scratch_ / "elsewhere";
  std::unique_ptr<Daemon> daemon_;
};

TEST_F(RecordedScenes, ASessionIsSteppedAgainFromItsRecordingAlone) {
  for (const bool ask : {false, true}) {
    fs::remove_all(folder_);
    fs::remove_all(elsewhere_);
    ask ? start() : start({"--record-scenes"});
    const Bytes uploaded = panel(0.5f).glb();
    const std::string hash = upload(uploaded);
    const std::string attached = attached_as(hash);
    const Heard heard = talk(hash, ask);
    test::stop(*daemon_);

    const Recording recording = test::open_recording(test::only_recording(folder_));
    test::expect_same(test::read_all(recording), heard);
    const auto sampler = make_embree_sampler_device();
    fs::create_directories(elsewhere_);
    const auto files = recording.files();
    ASSERT_TRUE(files);
    std::vector<std::string> names;
    for (const RecordedFile& file : *files) {
      names.push_back(file.name);
      if (file.name.starts_with("scene/")) write(elsewhere_ / file.name.substr(6), file.bytes);
    }
    EXPECT_THAT(names, UnorderedElementsAre("scene/room.glb", "scene/props/screen.gltf", "scene/props/data/screen.bin",
                                            "scene/late.glb", attached));
    LocalWorld world(elsewhere_, *sampler);
    for (const RecordedFile& file : *files) {
      if (file.name != attached) continue;
      EXPECT_TRUE(world.scenes.add_uploaded(std::as_bytes(std::span(file.bytes))));
    }
    EXPECT_EQ(test::expect_replay(recording, world), heard.replies.size());
  }
}

TEST_F(RecordedScenes, NobodyWhoDidNotAskHasThem) {
  start();
  talk(upload(panel(0.5f).glb()), false);
  test::stop(*daemon_);
  EXPECT_THAT(*test::open_recording(test::only_recording(folder_)).files(), IsEmpty());
}

// The second session opens the scene by its hash, while another session holds it. The recorded bytes are the file's.
TEST_F(RecordedScenes, ASceneThatWasLoadedByNameIsFoundByItsHash) {
  start({"--record-scenes", "--drain-s", "0"});
  v1::OpenSession named = open_with_boxes(1);
  named.mutable_scene()->set_name("room.glb");
  named.mutable_recording()->set_mode(v1::RecordingRequest::MODE_OFF);
  const Heard holder(address(), named);
  GeometryStore store;
  SceneLibrary library(scenes_, GltfLimits{}, store);
  const std::string hash = to_hex((*library.load_named("room.glb"))->hash);
  v1::OpenSession open = open_with_boxes(1);
  open.mutable_scene()->set_hash(hash);
  Heard heard(address(), open);
  EXPECT_TRUE(heard.finish().ok());
  test::stop(*daemon_);
  const auto files = test::open_recording(test::only_recording(folder_)).files();
  ASSERT_EQ(files->size(), 1u);
  EXPECT_EQ(files->at(0).name, attached_as(hash));
  EXPECT_EQ(files->at(0).bytes, text_of(panel(3).glb()));
}

}  // namespace
}  // namespace sightline
