// Files stay in their folder, with the kernel's help and without it.
#include "server/scene/confined_folder.h"

#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

// From now on openat2 fails in this process as on a kernel that does not have it.
bool take_openat2_away() {
  sock_filter program[] = {BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
                           BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_openat2, 0, 1),
                           BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | ENOSYS),
                           BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)};
  const sock_fprog filter{4, program};
  return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

class Confined : public testing::Test {
 protected:
  // scenes/inside.glb, and beside it scenes-secret/secret.glb, to which links lead.
  void SetUp() override {
    for (const char* name : {"scenes/deep", "scenes-secret"}) std::filesystem::create_directories(folder_ / name);
    std::ofstream(folder_ / "scenes/inside.glb") << "inside";
    std::ofstream(folder_ / "scenes-secret/secret.glb") << "secret";
    std::filesystem::create_symlink(folder_ / "scenes-secret/secret.glb", folder_ / "scenes/file.glb");
    std::filesystem::create_symlink("../scenes-secret", folder_ / "scenes/folder");
    std::filesystem::create_symlink("../inside.glb", folder_ / "scenes/deep/stays.glb");
  }

  // What is wrong; empty: nothing.
  std::string trouble() const {
    const auto scenes = ConfinedFolder::open(folder_ / "scenes");
    if (!scenes) return "the folder cannot be opened";
    for (const char* name : {"inside.glb", "deep/stays.glb"})
      if (const auto file = scenes->read(name, 100); !file || file->bytes.size() != 6)
        return std::string(name) + " cannot be read";
    for (const char* name : {"file.glb", "folder/secret.glb", "../scenes-secret/secret.glb",
                             "deep/../../scenes-secret/secret.glb", "/etc/passwd", "", "deep"})
      if (scenes->read(name, 100)) return std::string(name) + " was read";
    for (const char* name : {"file.glb", "folder/secret.glb"})
      if (scenes->stamp(name)) return std::string(name) + " has a stamp";
    return {};
  }

  [[noreturn]] void without_openat2() const {
    if (!take_openat2_away()) std::fputs("no filter", stderr), std::exit(2);
    const std::string found = trouble();
    std::fputs(found.empty() ? "confined" : found.c_str(), stderr);
    std::exit(found.empty() ? 0 : 1);
  }

  const test::TemporaryFolder folder_;
};

TEST_F(Confined, NothingLeadsOutOfTheFolder) {
  EXPECT_EQ(trouble(), "");
}

TEST_F(Confined, NorDoesItWithoutOpenat2) {
  EXPECT_EXIT(without_openat2(), testing::ExitedWithCode(0), "confined");
}

}  // namespace
}  // namespace sightline
