#include "server/gate/access.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "server/gate/small_file.h"
#include "tests/gate/settling_clock.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr char kSecret[] = "0123456789abcdef";
// printf 0123456789abcdeX | sha256sum
constexpr char kDigestOfAnother[] = "01e3c03ef0932ed1194078e2a4e3b314c48502e060eb96fca0705af48ace9796";

AccessList list_of(const std::string& text) {
  auto list = AccessList::parse(text);
  EXPECT_TRUE(list) << to_string(list.error());
  return std::move(*list);
}

std::string trouble_of(const std::string& text) {
  const auto list = AccessList::parse(text);
  if (list) return "none";
  EXPECT_EQ(list.error().field, "--access-file");
  return list.error().message;
}

const Peer kEncrypted{"10.0.0.1", std::nullopt, {}, true};

class AccessFile {
 public:
  void write(const std::string& text) const { std::ofstream(path()) << text; }
  std::string path() const { return folder_ / "access"; }

 private:
  const test::TemporaryFolder folder_;
};

TEST(AccessList, ATokenIsFoundByItsSecretOrByItsDigest) {
  const auto list = list_of(
      "# who may speak\n token a control 0123456789abcdef  # the first\n\ntoken b observe sha256:" +
      std::string(kDigestOfAnother) + "\n");
  ASSERT_TRUE(list.find_token(kSecret));
  EXPECT_EQ(list.find_token(kSecret)->name, "token a");
  EXPECT_EQ(list.find_token(kSecret)->role, Role::kControl);
  ASSERT_TRUE(list.find_token("0123456789abcdeX"));
  EXPECT_EQ(list.find_token("0123456789abcdeX")->name, "token b");
  for (const char* wrong : {"", "0123456789abcde", "0123456789abcdef ", "0123456789abcdefg", kDigestOfAnother})
    EXPECT_FALSE(list.find_token(wrong)) << wrong;
  EXPECT_FALSE(list.find_token(std::string(1 << 20, 'x')));
}

TEST(AccessList, ANumberSignWithinASecretBelongsToIt) {
  EXPECT_TRUE(list_of("token a control 0123456789#abcdef").find_token("0123456789#abcdef"));
}

TEST(AccessList, CertificatesAndUsersHaveNamesOrAreEveryone) {
  const auto list = list_of("certificate game-1 control\nuser 1000 admin\nuser root observe\n");
  EXPECT_EQ(list.find_certificate("game-1")->role, Role::kControl);
  EXPECT_FALSE(list.find_certificate("game-2"));
  EXPECT_FALSE(list.find_certificate(""));
  EXPECT_EQ(list.find_user(1000)->role, Role::kAdmin);
  EXPECT_EQ(list.find_user(0)->role, Role::kObserve);
  EXPECT_FALSE(list.find_user(1001));
  const auto open = list_of("certificate * observe\ncertificate game-1 control\nuser * control");
  EXPECT_EQ(open.find_certificate("game-2")->role, Role::kObserve);
  EXPECT_EQ(open.find_certificate("game-1")->role, Role::kControl);
  EXPECT_FALSE(open.find_certificate("")) << "no certificate is not everyone's";
  EXPECT_EQ(open.find_user(7)->name, "uid 7");
}

TEST(AccessList, AWrongLineIsNamed) {
  EXPECT_THAT(trouble_of("user 1 control\npassword a control x\n"), StartsWith("line 2: must begin with"));
  EXPECT_THAT(trouble_of("token a root 0123456789abcdef"), HasSubstr("must be control, observe or admin"));
  EXPECT_THAT(trouble_of("token a control"), HasSubstr("one secret"));
  EXPECT_THAT(trouble_of("token a control 0123456789abcdef more"), HasSubstr("one secret"));
  EXPECT_THAT(trouble_of("token a control 0123456789abcde"), HasSubstr("16 to 512"));
  EXPECT_THAT(trouble_of("token a control sha256:12"), HasSubstr("64 hexadecimal"));
  EXPECT_THAT(trouble_of("token a control sha256:" + std::string(63, '0') + "g"), HasSubstr("64 hexadecimal"));
  EXPECT_THAT(trouble_of("user 1 control secret"), HasSubstr("nothing may follow"));
  EXPECT_THAT(trouble_of("user no-such-user-here control"), HasSubstr("no user"));
  EXPECT_THAT(trouble_of("user 1 control\nuser 1 observe"), StartsWith("line 2: the name is there twice"));
  EXPECT_THAT(trouble_of("token a control 0123456789abcdef\ntoken a control 0123456789abcdeg"),
              HasSubstr("twice; it is already in line 1"));
}

TEST(AccessList, OneSecretHasOneName) {
  const std::string first = "# tokens\ntoken a control 0123456789abcdeX\ntoken b control 1123456789abcdef\n";
  EXPECT_EQ(trouble_of(first + "token c admin 0123456789abcdeX\n"),
            "line 4: the secret is there twice; it is already in line 2, for \"a\"");
  EXPECT_EQ(trouble_of(first + "token c admin sha256:" + kDigestOfAnother + "\n"),
            "line 4: the secret is there twice; it is already in line 2, for \"a\"");
}

TEST(Access, WithoutAFileEveryoneControlsAndObserves) {
  const Access access;
  const auto caller = access.identify({"127.0.0.1", std::nullopt, {}, false}, std::nullopt, Need::kControl);
  ASSERT_TRUE(caller);
  EXPECT_EQ(caller->name, "127.0.0.1");
  EXPECT_TRUE(caller->may(Need::kObserve));
  EXPECT_FALSE(caller->sees_all());
  EXPECT_EQ(access.identify({"127.0.0.1", std::nullopt, "game-1", true}, std::nullopt, Need::kControl)->name,
            "certificate game-1");
  EXPECT_TRUE(access.still_controls("127.0.0.1"));
}

TEST(Access, ARoleAllowsItsCallsOnly) {
  const AccessFile file;
  file.write("token a control 0123456789abcdef\ntoken b observe 1123456789abcdef\ntoken c admin 2123456789abcdef\n");
  const auto access = Access::load(file.path());
  ASSERT_TRUE(access);
  const auto may = [&](const char* token, Need need) {
    return (*access)->identify(kEncrypted, token, need).has_value();
  };
  for (const char* token : {"0123456789abcdef", "1123456789abcdef", "2123456789abcdef"})
    EXPECT_TRUE(may(token, Need::kAnyRole));
  EXPECT_TRUE(may("0123456789abcdef", Need::kControl));
  EXPECT_FALSE(may("0123456789abcdef", Need::kObserve));
  EXPECT_FALSE(may("1123456789abcdef", Need::kControl));
  EXPECT_TRUE(may("1123456789abcdef", Need::kObserve));
  EXPECT_TRUE(may("2123456789abcdef", Need::kControl));
  EXPECT_TRUE(may("2123456789abcdef", Need::kObserve));
  EXPECT_TRUE((*access)->identify(kEncrypted, "2123456789abcdef", Need::kAnyRole)->sees_all());
  EXPECT_FALSE((*access)->identify(kEncrypted, "0123456789abcdef", Need::kAnyRole)->sees_all());
  EXPECT_TRUE((*access)->identify(kEncrypted, "1123456789abcdef", Need::kControl).error().known);
  EXPECT_FALSE((*access)->identify(kEncrypted, "a wrong one", Need::kControl).error().known);
  EXPECT_EQ((*access)->refused(), 4u);
}

TEST(Access, ATokenIsJudgedAloneAndNeverOverAnOpenConnection) {
  const AccessFile file;
  file.write("token a control 0123456789abcdef\ncertificate game-1 control\nuser 1000 control\n");
  const auto access = Access::load(file.path());
  ASSERT_TRUE(access);
  const Peer open{"127.0.0.1", std::nullopt, {}, false}, game{"10.0.0.1", std::nullopt, "game-1", true},
      user{"uid 1000", 1000, {}, true};
  EXPECT_FALSE((*access)->identify(open, kSecret, Need::kControl));
  EXPECT_FALSE((*access)->identify(open, std::nullopt, Need::kControl));
  EXPECT_FALSE((*access)->identify(game, "a wrong one", Need::kControl)) << "although its certificate would do";
  EXPECT_FALSE((*access)->identify(user, "", Need::kControl)) << "although its user would do";
  EXPECT_EQ((*access)->identify(game, kSecret, Need::kControl)->name, "token a");
  EXPECT_EQ((*access)->identify(game, std::nullopt, Need::kControl)->name, "certificate game-1");
  EXPECT_EQ((*access)->identify(user, std::nullopt, Need::kControl)->name, "uid 1000");
}

TEST(Access, ABrokenFileIsToldOnceAndTheFormerContentsStay) {
  const AccessFile file;
  file.write("token a control 0123456789abcdef\n");
  const auto access = Access::load(file.path());
  ASSERT_TRUE(access);
  test::SettlingClock clock;
  const auto reload = [&] { return clock.settle([&](auto now) { return (*access)->reload(now); }); };
  EXPECT_EQ(reload().value(), false) << "nothing has changed";
  file.write("nonsense\n");
  EXPECT_FALSE(reload());
  EXPECT_EQ(reload().value(), false) << "it was told already";
  EXPECT_TRUE((*access)->identify(kEncrypted, kSecret, Need::kControl));
  file.write("token b control 1123456789abcdef\ntoken c observe 2123456789abcdef\n");
  EXPECT_EQ(reload().value(), true);
  EXPECT_FALSE((*access)->identify(kEncrypted, kSecret, Need::kControl));
  EXPECT_FALSE((*access)->still_controls("token a"));
  EXPECT_TRUE((*access)->still_controls("token b"));
  EXPECT_FALSE((*access)->still_controls("token c")) << "it only observes";
  EXPECT_FALSE((*access)->still_controls("uid 0"));
}

TEST(Access, AFileThatNamesNobodyIsNotTaken) {
  const AccessFile file;
  test::SettlingClock clock;
  for (const char* nobody : {"", "\n", "# nobody\n\n", " \t"}) {
    file.write(nobody);
    EXPECT_THAT(Access::load(file.path()).error().message, HasSubstr("at least one"));
    file.write("token a control 0123456789abcdef\n");
    const auto access = Access::load(file.path());
    ASSERT_TRUE(access);
    file.write(nobody);
    EXPECT_FALSE(clock.settle([&](auto now) { return (*access)->reload(now); }));
    EXPECT_TRUE((*access)->still_controls("token a"));
  }
}

// Each state of the file is valid by itself.
TEST(Access, AFileThatIsBeingRewrittenCountsWhenItHasSettled) {
  const AccessFile file;
  const std::string first = "token a control 0123456789abcdef\n", second = "token b control 1123456789abcdef\n";
  file.write(first + second);
  const auto access = Access::load(file.path());
  ASSERT_TRUE(access);
  SettledFiles::Time now{};
  const auto after = [&](int ms) {
    now += std::chrono::milliseconds(ms);
    return (*access)->reload(now).value();
  };
  for (int round = 0; round < 60; ++round) {
    file.write(first);
    EXPECT_FALSE(after(0));
    EXPECT_TRUE((*access)->settling());
    EXPECT_FALSE(after(900)) << "not for long enough";
    file.write(first + second + "# " + std::to_string(round) + '\n');
    EXPECT_FALSE(after(900)) << "it has changed again";
    EXPECT_TRUE((*access)->still_controls("token b"));
  }
  EXPECT_FALSE(after(900));
  EXPECT_TRUE(after(100));
  EXPECT_FALSE((*access)->settling());
  file.write(first);
  EXPECT_FALSE(after(0));
  EXPECT_TRUE(after(1000)) << "whoever is taken out goes as soon";
  EXPECT_FALSE((*access)->still_controls("token b"));
}

TEST(Access, AFileThatSomebodyHoldsOpenForWritingWaits) {
  const AccessFile file;
  file.write("token a control 0123456789abcdef\ntoken b control 1123456789abcdef\n");
  const auto access = Access::load(file.path());
  ASSERT_TRUE(access);
  std::ofstream writer(file.path());
  writer << "token a control 0123456789abcdef\n" << std::flush;
  if (!look_at_small_file(file.path(), "").value().being_written)
    GTEST_SKIP() << "this file system does not tell who writes";
  SettledFiles::Time now{};
  EXPECT_FALSE((*access)->reload(now).value());
  EXPECT_FALSE((*access)->reload(now + std::chrono::seconds(20)).value());
  EXPECT_TRUE((*access)->still_controls("token b"));
  EXPECT_TRUE((*access)->reload(now + SettledFiles::kPatience).value()) << "but not for ever";
}

TEST(Access, AFileThatIsReplacedOrGoneForAMomentIsNotTold) {
  const AccessFile file;
  file.write("token a control 0123456789abcdef\n");
  const auto access = Access::load(file.path());
  ASSERT_TRUE(access);
  SettledFiles::Time now{};
  std::filesystem::remove(file.path());
  EXPECT_FALSE((*access)->reload(now).value());
  file.write("token a control 0123456789abcdef\n");
  EXPECT_FALSE((*access)->reload(now + SettledFiles::kSettle).value()) << "it is as it was";
  EXPECT_FALSE((*access)->settling());
  std::filesystem::remove(file.path());
  EXPECT_FALSE((*access)->reload(now).value());
  EXPECT_THAT((*access)->reload(now + SettledFiles::kSettle).error().message, HasSubstr("No such file"));
}

TEST(Access, OthersMayNotReadItsSecretsNorWriteIt) {
  namespace fs = std::filesystem;
  const AccessFile file;
  const auto exposed = [&](const std::string& text, unsigned mode) {
    file.write(text);
    fs::permissions(file.path(), fs::perms(mode));
    return Access::load(file.path()).value()->exposed();
  };
  const std::string secret = "token a control 0123456789abcdef\n",
                    digest = "token a control sha256:" + std::string(kDigestOfAnother) + "\n";
  EXPECT_EQ(exposed(secret, 0600), "");
  EXPECT_EQ(exposed(secret, 0640), "");
  EXPECT_THAT(exposed(secret, 0644), HasSubstr("others can read it (mode 0644)"));
  EXPECT_THAT(exposed(secret, 0666), HasSubstr("others can read and write it (mode 0666)"));
  EXPECT_EQ(exposed(digest, 0644), "") << "it tells no secret";
  EXPECT_THAT(exposed(digest, 0602), HasSubstr("others can write it (mode 0602)"));
}

TEST(Access, AFileThatCannotBeReadIsAnError) {
  EXPECT_FALSE(Access::load("/nowhere/access"));
  const AccessFile file;
  file.write(std::string(2 << 20, '#'));
  EXPECT_THAT(Access::load(file.path()).error().message, HasSubstr("1 MiB"));
  file.write(std::string((1 << 20) + 1, '#'));
  EXPECT_FALSE(Access::load(file.path()));
  const std::string someone = "token a control 0123456789abcdef\n";
  file.write(someone + std::string((1 << 20) - someone.size(), '#'));
  EXPECT_TRUE(Access::load(file.path())) << "it is no larger";
  EXPECT_THAT(Access::load("/dev/zero").error().message, HasSubstr("regular file"));
  EXPECT_THAT(Access::load("/").error().message, HasSubstr("regular file"));
}

}  // namespace
}  // namespace sightline
