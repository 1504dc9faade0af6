#include "server/gate/access.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

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
  const auto list = list_of("# who may speak\n token a control 0123456789abcdef  # the first\n\ntoken b observe sha256:" +
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
  EXPECT_THAT(trouble_of("token a control 0123456789abcdef\ntoken a control 0123456789abcdeg"), HasSubstr("twice"));
}

TEST(Access, WithoutAFileEveryoneControlsAndObserves) {
  const Access access;
  const auto caller = access.identify({"127.0.0.1", std::nullopt, {}, false}, std::nullopt, Need::kControl);
  ASSERT_TRUE(caller);
  EXPECT_EQ(caller->name, "127.0.0.1");
  EXPECT_TRUE(caller->may(Need::kObserve));
  EXPECT_FALSE(caller->sees_all());
  EXPECT_EQ(access.identify({"127.0.0.1", std::nullopt, "game-1", true}, std::nullopt, Need::kControl)->name, "certificate game-1");
  EXPECT_TRUE(access.still_controls("127.0.0.1"));
}

TEST(Access, ARoleAllowsItsCallsOnly) {
  const AccessFile file;
  file.write("token a control 0123456789abcdef\ntoken b observe 1123456789abcdef\ntoken c admin 2123456789abcdef\n");
  const auto access = Access::load(file.path());
  ASSERT_TRUE(access);
  const auto may = [&](const char* token, Need need) { return (*access)->identify(kEncrypted, token, need).has_value(); };
  for (const char* token : {"0123456789abcdef", "1123456789abcdef", "2123456789abcdef"}) EXPECT_TRUE(may(token, Need::kAnyRole));
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
  const Peer open{"127.0.0.1", std::nullopt, {}, false}, game{"10.0.0.1", std::nullopt, "game-1", true}, user{"uid 1000", 1000, {}, true};
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
  EXPECT_EQ((*access)->reload().value(), false) << "nothing has changed";
  file.write("nonsense\n");
  EXPECT_FALSE((*access)->reload());
  EXPECT_EQ((*access)->reload().value(), false) << "it was told already";
  EXPECT_TRUE((*access)->identify(kEncrypted, kSecret, Need::kControl));
  file.write("token b control 1123456789abcdef\ntoken c observe 2123456789abcdef\n");
  EXPECT_EQ((*access)->reload().value(), true);
  EXPECT_FALSE((*access)->identify(kEncrypted, kSecret, Need::kControl));
  EXPECT_FALSE((*access)->still_controls("token a"));
  EXPECT_TRUE((*access)->still_controls("token b"));
  EXPECT_FALSE((*access)->still_controls("token c")) << "it only observes";
  EXPECT_FALSE((*access)->still_controls("uid 0"));
}

TEST(Access, AFileThatCannotBeReadIsAnError) {
  EXPECT_FALSE(Access::load("/nowhere/access"));
  const AccessFile file;
  file.write(std::string(2 << 20, '#'));
  EXPECT_THAT(Access::load(file.path()).error().message, HasSubstr("1 MiB"));
  file.write(std::string((1 << 20) + 1, '#'));
  EXPECT_FALSE(Access::load(file.path()));
  file.write(std::string(1 << 20, '#'));
  EXPECT_TRUE(Access::load(file.path())) << "it is no larger";
}

}  // namespace
}  // namespace sightline
