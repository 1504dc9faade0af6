#include "server/scene/scene_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <thread>

#include "tests/support/glb_builder.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;

std::vector<std::byte> triangle_glb(float x) {
  GlbBuilder file;
  file.mesh_node({{"attributes", {{"POSITION", file.floats({0, 0, 0, x, 0, 0, 0, 1, 0})}}}});
  return file.glb();
}

// root/scenes is the library's folder, root/secret.glb lies outside it.
class SceneFolder : public testing::Test {
 protected:
  SceneFolder() {
    write("secret.glb", triangle_glb(9));
    write("scenes/hall.glb", triangle_glb(1));
    write("scenes/levels/one.glb", triangle_glb(2));
  }

  void write(const std::string& path, const std::vector<std::byte>& bytes) {
    std::ofstream out(root / path, std::ios::binary);
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  // Moves a file's modification time forward, as an edit one second later would.
  void touch(const std::string& path) {
    fs::last_write_time(root / path, fs::last_write_time(root / path) + std::chrono::seconds(1));
  }
  Error error_of(const std::string& name) {
    const auto asset = library.load_named(name);
    return asset ? Error{ErrorCode::kInternal, "", "was loaded"} : asset.error();
  }

  // A library knows the files of its folder from the start.
  const test::TemporaryFolder root;
  const bool made = fs::create_directories(root / "scenes/levels");
  GeometryStore store;
  SceneLibrary library{(root / "scenes").string(), GltfLimits{}, store};
};

TEST_F(SceneFolder, NamesAreRelativePathsInOrder) {
  write("scenes/readme.txt", bytes_of("x"));
  EXPECT_THAT(library.names("", 10), ElementsAre("hall.glb", "levels/one.glb"));
  EXPECT_THAT(library.names("", 1), ElementsAre("hall.glb"));
}

TEST_F(SceneFolder, TheSameFileIsOneAssetAsLongAsItIsUsed) {
  const auto first = library.load_named("hall.glb");
  const auto second = library.load_named("hall.glb");
  ASSERT_TRUE(first && second);
  EXPECT_EQ(*first, *second);
  EXPECT_EQ(store.live_count(), 1u);
}

TEST_F(SceneFolder, NothingIsKeptForNobody) {
  const std::weak_ptr<const SceneAsset> gone = library.load_named("hall.glb").value();
  EXPECT_TRUE(gone.expired());
  EXPECT_EQ(store.live_count(), 0u);
}

TEST_F(SceneFolder, AChangedFileIsReadAnew) {
  const auto before = library.load_named("hall.glb");
  write("scenes/hall.glb", triangle_glb(5));
  touch("scenes/hall.glb");
  const auto after = library.load_named("hall.glb");
  ASSERT_TRUE(before && after);
  EXPECT_NE((*before)->hash, (*after)->hash);
  EXPECT_EQ((*after)->meshes.at(0)->bounds.max.x, 5.0f);
  EXPECT_EQ((*before)->meshes.at(0)->bounds.max.x, 1.0f) << "sessions keep what they opened";
}

TEST_F(SceneFolder, AChangeBesideTheFileIsSeenToo) {
  GlbBuilder file;
  file.triangle_node();
  write("scenes/levels/two.gltf", file.gltf("two.bin"));
  write("scenes/levels/two.bin", {file.binary().begin(), file.binary().end()});
  const auto before = library.load_named("levels/two.gltf");
  ASSERT_TRUE(before) << to_string(before.error());
  EXPECT_EQ(*library.load_named("levels/two.gltf"), *before);

  std::vector<std::byte> bytes(file.binary().begin(), file.binary().end());
  const float x = 7;
  std::memcpy(bytes.data() + 12, &x, sizeof x);
  write("scenes/levels/two.bin", bytes);
  touch("scenes/levels/two.bin");
  const auto after = library.load_named("levels/two.gltf");
  ASSERT_TRUE(after);
  EXPECT_EQ((*after)->meshes.at(0)->bounds.max.x, 7.0f);
}

TEST_F(SceneFolder, NamesThatLeaveTheFolderAreRefused) {
  const std::string with_nul("hall.glb\0/../../secret.glb", 26);
  for (const std::string& name :
       {std::string("../secret.glb"), std::string("levels/../../secret.glb"), (root / "secret.glb").string(),
        std::string("/secret.glb"), std::string(".."), std::string("../x.glb"), with_nul}) {
    const Error error = error_of(name);
    EXPECT_EQ(error.code, ErrorCode::kInvalidArgument) << name;
    EXPECT_EQ(error.field, "scene.name") << name;
  }
}

// A name is a path, not a URI: the escape is not decoded, so it names a folder that does not exist.
TEST_F(SceneFolder, PercentEscapesInNamesAreNotDecoded) {
  EXPECT_EQ(error_of("%2e%2e/secret.glb").code, ErrorCode::kNotFound);
}

TEST_F(SceneFolder, LinksOutOfTheFolderAreRefusedAndLinksWithinFollowed) {
  fs::create_symlink("../secret.glb", root / "scenes/out.glb");
  fs::create_symlink(root / "secret.glb", root / "scenes/absolute.glb");
  fs::create_directory_symlink("..", root / "scenes/up");
  fs::create_symlink("../hall.glb", root / "scenes/levels/same.glb");
  for (const char* name : {"out.glb", "absolute.glb", "up/secret.glb", "up/scenes/hall.glb"}) {
    EXPECT_EQ(error_of(name).code, ErrorCode::kInvalidArgument) << name;
    EXPECT_EQ(error_of(name).field, "scene.name") << name;
  }
  EXPECT_TRUE(library.load_named("levels/same.glb"));
  EXPECT_THAT(library.names("", 10), ElementsAre("hall.glb", "levels/one.glb", "levels/same.glb"));
}

TEST_F(SceneFolder, BuffersMayNotBeReachedThroughALinkOutOfTheFolder) {
  GlbBuilder file;
  file.triangle_node();
  write("scenes/a.gltf", file.gltf("a.bin"));
  fs::create_symlink("../secret.glb", root / "scenes/a.bin");
  const Error error = error_of("a.gltf");
  EXPECT_EQ(error.code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(error.field, "buffers[0].uri");
}

TEST_F(SceneFolder, MissingFilesAndFoldersAndPipesAreNamedErrors) {
  fs::create_directory(root / "scenes/folder.glb");
  ASSERT_EQ(mkfifo((root / "scenes/pipe.glb").c_str(), 0600), 0);
  EXPECT_EQ(error_of("absent.glb").code, ErrorCode::kNotFound);
  EXPECT_EQ(error_of("hall.glb/x.glb").code, ErrorCode::kNotFound);
  EXPECT_EQ(error_of("folder.glb").code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(error_of("pipe.glb").code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(error_of("").code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(error_of("hall.txt").code, ErrorCode::kInvalidArgument);
  std::string long_name(5000, 'a');
  long_name += ".glb";
  EXPECT_EQ(error_of(long_name).code, ErrorCode::kInvalidArgument);
}

TEST_F(SceneFolder, ABrokenFileSaysWhatIsBroken) {
  write("scenes/broken.glb", bytes_of("glTF"));
  EXPECT_EQ(error_of("broken.glb").field, "glb.header");
}

TEST_F(SceneFolder, AFileAboveTheLimitIsNotRead) {
  GltfLimits limits;
  limits.max_file_bytes = 10;
  SceneLibrary small((root / "scenes").string(), limits, store);
  const auto asset = small.load_named("hall.glb");
  ASSERT_FALSE(asset);
  EXPECT_EQ(asset.error().code, ErrorCode::kResourceExhausted);
}

TEST_F(SceneFolder, WithoutAFolderNothingHasAName) {
  SceneLibrary none("", GltfLimits{}, store);
  EXPECT_EQ(none.load_named("hall.glb").error().code, ErrorCode::kFailedPrecondition);
  EXPECT_TRUE(none.names("", 10).empty());
  SceneLibrary lost((root / "absent").string(), GltfLimits{}, store);
  EXPECT_EQ(lost.load_named("hall.glb").error().code, ErrorCode::kUnavailable);
}

TEST_F(SceneFolder, AnOwnerPushesOutItsOwnUploadsBeforeThoseOfOthers) {
  const auto other = library.add_uploaded(triangle_glb(100), "other");
  ASSERT_TRUE(other);
  const ContentHash hash = (*other)->hash, first = (*library.add_uploaded(triangle_glb(199), "many"))->hash;
  for (size_t i = 0; i < SceneLibrary::kKeptUploads; ++i)
    ASSERT_TRUE(library.add_uploaded(triangle_glb(200.0f + static_cast<float>(i)), "many"));
  EXPECT_FALSE(library.find(first, {"many"}));
  EXPECT_TRUE(library.find(hash, {"other"}));
}

TEST_F(SceneFolder, ManySmallUploadsDoNotPushOutALargeOneOfAnother) {
  std::vector<float> corners;
  for (int i = 0; i < 90'000; ++i) corners.push_back(100.0f * std::sin(static_cast<float>(i)));
  GlbBuilder large;
  large.mesh_node({{"attributes", {{"POSITION", large.floats(corners)}}}});
  const ContentHash hash = (*library.add_uploaded(large.glb(), "other"))->hash;
  for (size_t i = 0; i < 2 * SceneLibrary::kKeptUploads; ++i)
    ASSERT_TRUE(library.add_uploaded(triangle_glb(static_cast<float>(i + 1)), "many"));
  EXPECT_TRUE(library.find(hash, {"other"}));
}

TEST_F(SceneFolder, AnOwnerWithinItsShareOfTheBytesLosesNothing) {
  const auto one = *library.add_uploaded(triangle_glb(100), "measured");
  const size_t bytes = sizeof(SceneAsset) + one->nodes.size() * sizeof(AssetNode) + one->meshes.at(0)->bytes();
  SceneLibrary small("", GltfLimits{}, store, false, 8 * bytes);
  std::vector<ContentHash> hashes;
  for (const float x : {1.0f, 2.0f, 3.0f, 4.0f})
    hashes.push_back((*small.add_uploaded(triangle_glb(x), "other"))->hash);
  for (const float x : {11.0f, 12.0f, 13.0f, 14.0f, 15.0f, 16.0f, 17.0f})
    ASSERT_TRUE(small.add_uploaded(triangle_glb(x), "many"));
  for (const ContentHash& hash : hashes) EXPECT_TRUE(small.find(hash, {"other"}));
}

TEST_F(SceneFolder, TheUploadsOfOneOwnerTakeABoundedMemory) {
  const auto one = *library.add_uploaded(triangle_glb(100), "measured");
  const size_t bytes = sizeof(SceneAsset) + one->nodes.size() * sizeof(AssetNode) + one->meshes.at(0)->bytes();
  SceneLibrary small("", GltfLimits{}, store, false, size_t{64} << 20, 2 * bytes);
  const auto first = *small.add_uploaded(triangle_glb(1), "me");
  const ContentHash unused = (*small.add_uploaded(triangle_glb(2), "me"))->hash;
  // The third upload takes the room of the unused one. The fourth finds no room.
  const auto third = *small.add_uploaded(triangle_glb(3), "me");
  EXPECT_FALSE(small.find(unused, {"me"}));
  EXPECT_EQ(*small.find(first->hash, {"me"}), first);
  const auto fourth = small.add_uploaded(triangle_glb(4), "me");
  ASSERT_FALSE(fourth);
  EXPECT_EQ(fourth.error().code, ErrorCode::kResourceExhausted);
  EXPECT_NE(fourth.error().message.find("(--client-scenes-memory-mib)"), std::string::npos);
  // A file that is loaded already takes no more memory. Another owner has a share of its own.
  EXPECT_TRUE(small.add_uploaded(triangle_glb(3), "me"));
  EXPECT_TRUE(small.add_uploaded(triangle_glb(4), "you"));
}

TEST_F(SceneFolder, UploadsThatFillTheLimitOfTheirOwnerExactlyAreTakenAndNotAByteMore) {
  const auto one = *library.add_uploaded(triangle_glb(100), "measured");
  const size_t bytes = sizeof(SceneAsset) + one->nodes.size() * sizeof(AssetNode) + one->meshes.at(0)->bytes();
  for (const size_t limit : {2 * bytes, 2 * bytes - 1}) {
    SceneLibrary small("", GltfLimits{}, store, false, size_t{64} << 20, limit);
    const auto first = small.add_uploaded(triangle_glb(1), "me"), second = small.add_uploaded(triangle_glb(2), "me");
    EXPECT_TRUE(first);
    EXPECT_EQ(second.has_value(), limit == 2 * bytes);
  }
}

TEST_F(SceneFolder, ARefusedUploadCostsItsOwnerNoOther) {
  const auto one = *library.add_uploaded(triangle_glb(100), "measured");
  const size_t bytes = sizeof(SceneAsset) + one->nodes.size() * sizeof(AssetNode) + one->meshes.at(0)->bytes();
  SceneLibrary small("", GltfLimits{}, store, false, size_t{64} << 20, 2 * bytes);
  const ContentHash unused = (*small.add_uploaded(triangle_glb(1), "me"))->hash;
  std::vector<float> corners;
  for (int i = 0; i < 9'000; ++i) corners.push_back(100.0f * std::sin(static_cast<float>(i)));
  GlbBuilder large;
  large.mesh_node({{"attributes", {{"POSITION", large.floats(corners)}}}});
  EXPECT_FALSE(small.add_uploaded(large.glb(), "me"));
  EXPECT_TRUE(small.find(unused, {"me"}));
}

TEST_F(SceneFolder, AnUploadIsFoundByItsOwnerAndByThoseWhoSeeAll) {
  const auto mine = library.add_uploaded(triangle_glb(100), "me");
  ASSERT_TRUE(mine);
  const ContentHash hash = (*mine)->hash;
  EXPECT_EQ(*library.find(hash, {"me"}), *mine);
  EXPECT_EQ(*library.find(hash, {.client = "root", .sees_all = true}), *mine);
  EXPECT_EQ(library.find(hash, {"other"}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(library.find(hash).error().code, ErrorCode::kNotFound);
}

TEST_F(SceneFolder, EqualUploadsOfTwoOwnersShareTheirGeometryOnly) {
  const auto mine = library.add_uploaded(triangle_glb(100), "me"),
             yours = library.add_uploaded(triangle_glb(100), "you");
  ASSERT_TRUE(mine && yours);
  EXPECT_NE(*mine, *yours);
  EXPECT_EQ((*mine)->meshes.at(0), (*yours)->meshes.at(0));
  EXPECT_EQ(*library.find((*mine)->hash, {"you"}), *yours);
}

TEST_F(SceneFolder, EveryoneFindsANamedScene) {
  const auto named = library.load_named("hall.glb");
  ASSERT_TRUE(named);
  EXPECT_EQ(*library.find((*named)->hash, {"anyone"}), *named);
}

TEST_F(SceneFolder, TheBytesOfAnUploadAreItsOwners) {
  SceneLibrary keeper("", GltfLimits{}, store, true);
  const auto mine = keeper.add_uploaded(triangle_glb(100), "me");
  ASSERT_TRUE(mine);
  EXPECT_TRUE(keeper.files_of((*mine)->hash, {"me"}));
  EXPECT_EQ(keeper.files_of((*mine)->hash, {"you"}).error().code, ErrorCode::kNotFound);
}

TEST_F(SceneFolder, KeptUploadsTakeABoundedMemory) {
  SceneLibrary small("", GltfLimits{}, store, false, 1);
  const ContentHash first = (*small.add_uploaded(triangle_glb(100)))->hash;
  EXPECT_TRUE(small.find(first));
  const ContentHash second = (*small.add_uploaded(triangle_glb(200)))->hash;
  EXPECT_FALSE(small.find(first));
  EXPECT_TRUE(small.find(second));
}

TEST_F(SceneFolder, UploadsAreFoundByHashUntilNewerOnesPushThemOut) {
  const ContentHash first = (*library.add_uploaded(triangle_glb(100)))->hash;
  EXPECT_TRUE(library.find(first));
  for (size_t i = 0; i < SceneLibrary::kKeptUploads; ++i)
    ASSERT_TRUE(library.add_uploaded(triangle_glb(200.0f + static_cast<float>(i))));
  const auto lost = library.find(first);
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(lost.error().field, "scene.hash");
}

TEST_F(SceneFolder, AnUploadOfALoadedFileIsTheSameAsset) {
  const auto named = library.load_named("hall.glb");
  const auto uploaded = library.add_uploaded(triangle_glb(1));
  ASSERT_TRUE(named && uploaded);
  EXPECT_EQ(*named, *uploaded);
}

TEST_F(SceneFolder, UploadsMayNotReferToFiles) {
  GlbBuilder file;
  file.triangle_node();
  const auto asset = library.add_uploaded(file.gltf("hall.glb"));
  ASSERT_FALSE(asset);
  EXPECT_EQ(asset.error().field, "buffers[0].uri");
}

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

TEST_F(SceneFolder, TheFilesOfALoadedSceneCanBeHadAgain) {
  GlbBuilder parts;
  parts.triangle_node();
  write("scenes/levels/two.gltf", parts.gltf("bin/two.bin"));
  fs::create_directories(root / "scenes/levels/bin");
  write("scenes/levels/bin/two.bin", {parts.binary().begin(), parts.binary().end()});
  EXPECT_EQ(library.files_of("levels/two.gltf").error().code, ErrorCode::kNotFound) << "not loaded";
  const auto two = library.load_named("levels/two.gltf");
  ASSERT_TRUE(two);
  const auto files = library.files_of("levels/two.gltf");
  ASSERT_TRUE(files);
  ASSERT_EQ(files->size(), 2u);
  EXPECT_EQ(files->at(0).name, "levels/two.gltf");
  EXPECT_EQ(*files->at(0).bytes, text_of(parts.gltf("bin/two.bin")));
  EXPECT_EQ(files->at(1).name, "levels/bin/two.bin");
  EXPECT_EQ(*files->at(1).bytes, text_of({parts.binary().begin(), parts.binary().end()}));
  EXPECT_EQ(library.files_of((*two)->hash)->at(1).bytes, files->at(1).bytes) << "shared while they are held";
}

TEST_F(SceneFolder, AFileThatHasChangedSinceItWasLoadedIsNotTakenForIt) {
  const auto hall = library.load_named("hall.glb");
  ASSERT_TRUE(hall);
  auto before = library.files_of("hall.glb");
  ASSERT_TRUE(before);
  write("scenes/hall.glb", triangle_glb(3));
  touch("scenes/hall.glb");
  EXPECT_EQ(*library.files_of("hall.glb")->at(0).bytes, text_of(triangle_glb(1))) << "somebody holds them still";
  before->clear();
  const auto after = library.files_of("hall.glb");
  ASSERT_FALSE(after);
  EXPECT_EQ(after.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_EQ(after.error().field, "scene.name");
  fs::remove(root / "scenes/hall.glb");
  EXPECT_EQ(library.files_of("hall.glb").error().code, ErrorCode::kNotFound);
}

TEST_F(SceneFolder, AnUploadsBytesAreKeptWhereTheyAreWanted) {
  SceneLibrary keeper((root / "scenes").string(), GltfLimits{}, store, true);
  const std::vector<std::byte> bytes = triangle_glb(5);
  ContentHash hash;
  for (SceneLibrary* one : {&library, &keeper}) {
    const auto asset = one->add_uploaded(bytes);
    ASSERT_TRUE(asset);
    hash = (*asset)->hash;
  }
  EXPECT_EQ(library.files_of(hash).error().code, ErrorCode::kNotFound);
  const auto files = keeper.files_of(hash);
  ASSERT_TRUE(files);
  ASSERT_EQ(files->size(), 1u);
  EXPECT_EQ(files->at(0).name, "");
  EXPECT_EQ(*files->at(0).bytes, text_of(bytes));
  // An upload that equals a file loaded by name is the same scene, because the bytes are equal.
  const auto hall = keeper.load_named("hall.glb");
  ASSERT_TRUE(hall && keeper.add_uploaded(triangle_glb(1)));
  EXPECT_EQ(*keeper.files_of((*hall)->hash)->at(0).bytes, text_of(triangle_glb(1)));
}

TEST_F(SceneFolder, AnUploadsBytesGoWithItsAsset) {
  SceneLibrary keeper("", GltfLimits{}, store, true);
  const auto first = (*keeper.add_uploaded(triangle_glb(1000)))->hash;  // no other one is so wide
  for (size_t i = 0; i < SceneLibrary::kKeptUploads; ++i)
    ASSERT_TRUE(keeper.add_uploaded(triangle_glb(static_cast<float>(i + 1))));
  EXPECT_EQ(keeper.files_of(first).error().code, ErrorCode::kNotFound);
}

TEST_F(SceneFolder, ManyThreadsShareOneAsset) {
  std::vector<std::shared_ptr<const SceneAsset>> assets(8);
  std::vector<std::thread> threads;
  for (auto& asset : assets)
    threads.emplace_back([&] {
      for (int i = 0; i < 20; ++i) asset = library.load_named("hall.glb").value_or(nullptr);
    });
  for (auto& thread : threads) thread.join();
  for (const auto& asset : assets) EXPECT_EQ(asset, assets[0]);
  EXPECT_NE(assets[0], nullptr);
}

}  // namespace
}  // namespace sightline
