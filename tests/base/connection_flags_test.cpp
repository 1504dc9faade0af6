#include "client/base/connection_flags.h"

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <fstream>
#include <string>

#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

class ConnectionFlagsTest : public testing::Test {
 protected:
  // Writes a file, and returns its path.
  std::string file(const std::string& name, const std::string& content) {
    const std::filesystem::path path = folder_ / name;
    std::ofstream(path, std::ios::binary) << content;
    return path;
  }
  test::TemporaryFolder folder_;
};

TEST_F(ConnectionFlagsTest, WithoutAFlagThereIsNoTlsAndNoToken) {
  const auto read = read_credentials({});
  ASSERT_TRUE(read.has_value());
  EXPECT_FALSE(read->tls);
  EXPECT_EQ(read->roots + read->certificate + read->key + read->token, "");
}

TEST_F(ConnectionFlagsTest, EachFileIsReadWholeIntoItsOwnField) {
  const std::string nul("certificate\0\n", 13);
  const auto read = read_credentials({.tls = false,
                                      .roots = file("roots", "roots\n"),
                                      .certificate = file("certificate", nul),
                                      .key = file("key", "key\r\n"),
                                      .token = file("token", "to ken\r\n\n")});
  ASSERT_TRUE(read.has_value());
  EXPECT_TRUE(read->tls);
  EXPECT_EQ(read->roots, "roots\n");
  EXPECT_EQ(read->certificate, nul);
  EXPECT_EQ(read->key, "key\r\n");
  EXPECT_EQ(read->token, "to ken") << "without the ends of lines that an editor writes";
}

TEST_F(ConnectionFlagsTest, RootsOrACertificateImplyTls) {
  EXPECT_TRUE(read_credentials({.tls = true})->tls);
  EXPECT_TRUE(read_credentials({.roots = file("roots", "r")})->tls);
  EXPECT_TRUE(read_credentials({.certificate = file("certificate", "c"), .key = file("key", "k")})->tls);
  EXPECT_FALSE(read_credentials({.token = file("token", "t")})->tls) << "a token may go over a unix socket";
}

TEST_F(ConnectionFlagsTest, ACertificateNeedsItsKeyAndAKeyItsCertificate) {
  const auto no_key = read_credentials({.certificate = file("certificate", "c")});
  ASSERT_FALSE(no_key.has_value());
  EXPECT_EQ(no_key.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(no_key.error().field, "--tls-key");
  const auto no_certificate = read_credentials({.key = file("key", "k")});
  ASSERT_FALSE(no_certificate.has_value());
  EXPECT_EQ(no_certificate.error().field, "--tls-cert");
}

TEST_F(ConnectionFlagsTest, AFileThatCannotBeReadIsNamedWithItsFlag) {
  const std::string here = file("here", "x"), gone = folder_ / "gone";
  const std::pair<ConnectionFlags, const char*> cases[] = {{{.roots = gone}, "--tls-roots"},
                                                           {{.certificate = gone, .key = here}, "--tls-cert"},
                                                           {{.certificate = here, .key = gone}, "--tls-key"},
                                                           {{.token = gone}, "--token-file"},
                                                           {{.roots = gone, .token = gone}, "--tls-roots"}};
  for (const auto& [flags, name] : cases) {
    const auto read = read_credentials(flags);
    ASSERT_FALSE(read.has_value()) << name;
    EXPECT_EQ(read.error().code, ErrorCode::kUnavailable) << name;
    EXPECT_EQ(read.error().field, name);
    EXPECT_NE(read.error().message.find(gone), std::string::npos) << read.error().message;
  }
}

TEST(ConnectionFlagsOfACommand, EachFlagHasAFieldOfItsOwn) {
  CLI::App command;
  ConnectionFlags flags;
  add_connection_flags(command, flags);
  command.parse(
      std::vector<std::string>{"t", "--token-file", "k", "--tls-key", "c", "--tls-cert", "r", "--tls-roots", "--tls"});
  EXPECT_TRUE(flags.tls);
  EXPECT_EQ(flags.roots + flags.certificate + flags.key + flags.token, "rckt");
}

}  // namespace
}  // namespace sightline
