#include "server/gate/listening_socket.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

TEST(ListeningSocket, APortIsNotShared) {
  const auto first = ListeningSocket::tcp("127.0.0.1:0");
  ASSERT_TRUE(first);
  EXPECT_NE(first->port(), 0);
  const auto second = ListeningSocket::tcp(first->address());
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(second.error().field, "--listen");
}

TEST(ListeningSocket, ASocketFileHasItsModeAndGoesWithItsOwner) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "socket";
  {
    const auto socket = ListeningSocket::unix_file(path, 0640);
    ASSERT_TRUE(socket);
    struct stat info {};
    ASSERT_EQ(::lstat(path.c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777, 0640u);
    EXPECT_FALSE(ListeningSocket::unix_file(path, 0640)) << "it is served";
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(ListeningSocket, TheFileOfAnotherOneStays) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "socket";
  auto first = ListeningSocket::unix_file(path, 0600);
  ASSERT_TRUE(first);
  std::filesystem::remove(path);
  const auto second = ListeningSocket::unix_file(path, 0600);
  ASSERT_TRUE(second);
  first = fail(ErrorCode::kInternal, "", "");
  EXPECT_TRUE(std::filesystem::exists(path));
}

// The kernel takes a path that fills its structure, but then has no end of it.
TEST(ListeningSocket, APathIsNoLongerThanTheKernelsStructure) {
  const test::TemporaryFolder folder;
  const std::string start = folder / "";
  const auto of_length = [&](size_t length) {
    return ListeningSocket::unix_file(start + std::string(length - start.size(), 'x'), 0600);
  };
  EXPECT_TRUE(of_length(107));
  for (const size_t length : {108, 109, 300}) {
    const auto socket = of_length(length);
    ASSERT_FALSE(socket) << length;
    EXPECT_EQ(socket.error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(socket.error().field, "--listen-unix");
  }
}

TEST(ListeningSocket, AFileThatIsNoSocketIsLeftAlone) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "file";
  std::ofstream(path) << "text";
  EXPECT_FALSE(ListeningSocket::unix_file(path, 0600));
  EXPECT_TRUE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace sightline
