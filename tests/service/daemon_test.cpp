// The daemon from outside: its flags, its listeners, and how it ends.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/service/daemon.h"
#include "tests/service/raw_call.h"
#include "tests/service/service_world.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

// --- flags
// -------------------------------------------------------------------------------------------------------

TEST(DaemonFlags, AnUnknownOneIsAnError) {
  const RunResult result = run_sightlined({"--no-such-flag"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.errors.find("no-such-flag"), std::string::npos);
}

TEST(DaemonFlags, AValueOutOfRangeIsAnError) {
  const std::vector<std::vector<std::string>> wrong{{"--sampler", "magic"},
                                                    {"--listen", "nowhere"},
                                                    {"--listen", "127.0.0.1:70000"},
                                                    {"--threads", "-1"},
                                                    {"--max-sessions", "0"},
                                                    {"--unix-mode", "abc"},
                                                    {"--scene-dir", "/no/such/dir"},
                                                    {"--drain-s", "-1"},
                                                    {"--log-level", "chatty"},
                                                    {"--egl-device", "-2"},
                                                    {"--max-message-mib", "0"},
                                                    {"stray"},
                                                    {"--max-upload-mib", "nine"},
                                                    {"--config", "/no/such/file"},
                                                    {"--open-timeout-s", "0"},
                                                    {"--scene-dir", std::string(300, 'x')},
                                                    {"--upload-timeout-s", "0"},
                                                    {"--upload-timeout-s", "nan"},
                                                    {"--drain-s", "nan"},
                                                    {"--step-budget-ms", "nan"},
                                                    {"--listen", "none"},
                                                    {"--step-budget-ms", "-1"},
                                                    {"--step-budget-ms", "1001"},
                                                    {"--record", "some"},
                                                    {"--record-total-mib", "0"},
                                                    {"--record-age-h", "-1"},
                                                    {"--record-file-mib", "0"}};
  for (const auto& arguments : wrong) EXPECT_EQ(run_sightlined(arguments).exit_code, 2) << arguments.front();
}

TEST(DaemonFlags, EveryOneIsExplained) {
  const RunResult help = run_sightlined({"--help"});
  EXPECT_EQ(help.exit_code, 0);
  for (const char* flag :
       {"--listen ",           "--listen-unix",      "--unix-mode",        "--scene-dir",       "--sampler",
        "--egl-device",        "--require-gpu",      "--threads",          "--max-sessions",    "--max-message-mib",
        "--max-upload-mib",    "--log-format",       "--log-level",        "--ready-file",      "--drain-s",
        "--version",           "--print-config",     "--check-config",     "--config",          "devices",
        "--open-timeout-s",    "--upload-timeout-s", "--step-budget-ms",   "--no-degrade",      "--record-dir",
        "--record ",           "--record-scenes",    "--record-total-mib", "--record-file-mib", "--record-age-h",
        "--record-reserve-mib"}) {
    EXPECT_NE(help.output.find(flag), std::string::npos) << flag;
  }
}

TEST(DaemonFlags, APrintedConfigurationReadsBackTheSame) {
  const RunResult first = run_sightlined({"--listen",
                                          "none",
                                          "--listen-unix",
                                          "/tmp/a b.sock",
                                          "--sampler",
                                          "embree",
                                          "--max-sessions",
                                          "7",
                                          "--drain-s",
                                          "0.25",
                                          "--require-gpu",
                                          "--unix-mode",
                                          "0600",
                                          "--step-budget-ms",
                                          "2.5",
                                          "--no-degrade",
                                          "--log-format",
                                          "json",
                                          "--record-dir",
                                          "/tmp/a b",
                                          "--record",
                                          "asked",
                                          "--record-scenes",
                                          "--record-total-mib",
                                          "77",
                                          "--record-age-h",
                                          "5",
                                          "--print-config"});
  ASSERT_EQ(first.exit_code, 0) << first.errors;
  for (const char* line : {"max-sessions=7", "record=\"asked\"", "record-scenes=true", "record-total-mib=77"})
    EXPECT_NE(first.output.find(line), std::string::npos) << first.output;
  const test::TemporaryFolder folder;
  std::ofstream(folder / "sightlined.conf") << first.output;
  const RunResult second = run_sightlined({"--config", folder / "sightlined.conf", "--print-config"});
  EXPECT_EQ(second.exit_code, 0) << second.errors;
  EXPECT_EQ(second.output, first.output);
  EXPECT_EQ(run_sightlined({"--config", folder / "sightlined.conf", "--check-config"}).exit_code, 0);
}

TEST(DaemonFlags, ValuesOfAConfigurationFileMayHaveQuotesBlanksAndHashes) {
  const test::TemporaryFolder folder;
  for (const char* value : {"/a#b", "/a \"b\"", "/it's", "'", "\"", "/a, b", "[/a]", "/a\" # b", "1e3"}) {
    const RunResult first = run_sightlined({"--record-dir", value, "--print-config"});
    ASSERT_EQ(first.exit_code, 0) << first.errors;
    std::ofstream(folder / "sightlined.conf") << first.output;
    const RunResult second = run_sightlined({"--config", folder / "sightlined.conf", "--print-config"});
    EXPECT_EQ(second.exit_code, 0) << value << second.errors;
    EXPECT_EQ(second.output, first.output) << value;
  }
}

TEST(DaemonFlags, AValueThatNoConfigurationFileCanHoldIsNotPrinted) {
  for (const char* value : {"/it's \"a\"", "/a\nb", " /a", "/a "}) {
    const RunResult printed = run_sightlined({"--record-dir", value, "--print-config"});
    EXPECT_EQ(printed.exit_code, 2) << value;
    EXPECT_NE(printed.errors.find("--record-dir"), std::string::npos) << printed.errors;
  }
}

TEST(DaemonFlags, AValueOfAConfigurationFileEndsWithItsQuote) {
  const test::TemporaryFolder folder;
  std::ofstream(folder / "commented.conf") << "record-dir = \"/a#b\"  # \"c\"\nsampler = embree # d\n";
  const RunResult printed = run_sightlined({"--config", folder / "commented.conf", "--print-config"});
  EXPECT_NE(printed.output.find("record-dir=\"/a#b\"\n"), std::string::npos) << printed.output << printed.errors;
  for (const char* line : {"record-dir = \"/a", "record-dir = \"/a\" b", "record-dir = '/a\"",
                           "record-dir = /it's \"a\"", "listen = [1, 2]"}) {
    std::ofstream(folder / "wrong.conf") << line << '\n';
    const RunResult checked = run_sightlined({"--config", folder / "wrong.conf", "--check-config"});
    EXPECT_EQ(checked.exit_code, 2) << line;
    EXPECT_NE(checked.errors.find("line 1"), std::string::npos) << checked.errors;
  }
}

TEST(DaemonFlags, AConfigurationFileWithAnUnknownEntryIsAnError) {
  const test::TemporaryFolder folder;
  std::ofstream(folder / "sightlined.conf") << "max-sesions=7\n";
  EXPECT_EQ(run_sightlined({"--config", folder / "sightlined.conf", "--check-config"}).exit_code, 2);
}

TEST(DaemonFlags, DevicesReportsEmbreeAlways) {
  const RunResult report = run_sightlined({"devices", "--sampler", "embree"});
  EXPECT_EQ(report.exit_code, 0);
  EXPECT_NE(report.output.find("embree"), std::string::npos) << report.output;
}

TEST(DaemonFlags, TheSamplerIsTheOneThatWasAskedFor) {
  for (const char* sampler : {"embree", "egl"}) {
    const RunResult report = run_sightlined({"devices", "--sampler", sampler});
    EXPECT_NE(report.output.find("used because: asked for with --sampler"), std::string::npos)
        << sampler << report.output;
  }
  EXPECT_EQ(run_sightlined({"devices"}).output.find("asked for"), std::string::npos);
}

TEST(DaemonFlags, WhatIsForOneRunOnlyIsNoPartOfAConfiguration) {
  const RunResult printed = run_sightlined({"--inject-fault", "sampler:3", "--print-config"});
  ASSERT_EQ(printed.exit_code, 0) << printed.errors;
  const test::TemporaryFolder folder;
  for (const std::string name : {"inject-fault", "config", "print-config", "check-config", "version", "describe",
                                 "help", "json", "live", "tls", "address", "devices", "healthcheck"}) {
    EXPECT_EQ(printed.output.find("\n" + name + "="), std::string::npos) << name;
    EXPECT_EQ(printed.output.find("\n" + name + "."), std::string::npos) << name;
    EXPECT_EQ(printed.output.find("[" + name + "]"), std::string::npos) << name;
    std::ofstream(folder / "wrong.conf") << "# none\n" << name << " = true\n";
    const RunResult checked = run_sightlined({"--config", folder / "wrong.conf", "--check-config"});
    EXPECT_EQ(checked.exit_code, 2) << name;
    EXPECT_NE(checked.errors.find("line 2"), std::string::npos) << name << checked.errors;
  }
}

// --- listeners
// ---------------------------------------------------------------------------------------------------

TEST(Daemon, ListensAtTcpAndAtAUnixSocketWithItsMode) {
  const test::TemporaryFolder folder;
  Daemon daemon({"--listen", "127.0.0.1:0", "--listen-unix", folder / "s.sock", "--unix-mode", "0600"});
  ASSERT_TRUE(daemon.wait_until_ready()) << daemon.errors();
  ASSERT_EQ(daemon.addresses().size(), 2u);
  for (const std::string& address : daemon.addresses()) {
    EXPECT_EQ(server_info(connect(address)).sampler(), "embree") << address;
    EXPECT_EQ(health_of(connect(address), ""), 1) << address;
  }
  struct stat info {};
  ASSERT_EQ(::stat((folder / "s.sock").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777u, 0600u);
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0);
  EXPECT_FALSE(std::filesystem::exists(folder / "s.sock"));
}

TEST(Daemon, ASecondOneAtTheSamePortEndsAndTheFirstGoesOn) {
  Daemon first({"--listen", "127.0.0.1:0"});
  ASSERT_TRUE(first.wait_until_ready()) << first.errors();
  const RunResult second = run_sightlined({"--sampler", "embree", "--listen", first.addresses().front()});
  EXPECT_GT(second.exit_code, 0);
  EXPECT_NE(second.errors.find("--listen"), std::string::npos) << second.errors;
  EXPECT_EQ(health_of(connect(first.addresses().front()), ""), 1);
}

TEST(Daemon, ASecondOneAtTheSameSocketEndsAndTheFirstGoesOn) {
  const test::TemporaryFolder folder;
  const std::vector<std::string> arguments{"--listen", "none", "--listen-unix", folder / "s.sock"};
  Daemon first(arguments);
  ASSERT_TRUE(first.wait_until_ready()) << first.errors();
  Daemon second(arguments);
  EXPECT_FALSE(second.wait_until_ready());
  EXPECT_NE(second.errors().find("another process serves it"), std::string::npos) << second.errors();
  EXPECT_EQ(health_of(connect(first.addresses().front()), ""), 1);
}

TEST(Daemon, ASocketLeftBehindByAKilledOneIsTakenOver) {
  const test::TemporaryFolder folder;
  const std::vector<std::string> arguments{"--listen", "none", "--listen-unix", folder / "s.sock"};
  Daemon killed(arguments);
  ASSERT_TRUE(killed.wait_until_ready()) << killed.errors();
  killed.signal(SIGKILL);
  EXPECT_EQ(killed.wait(), -SIGKILL);
  ASSERT_TRUE(std::filesystem::exists(folder / "s.sock"));
  Daemon next(arguments);
  ASSERT_TRUE(next.wait_until_ready()) << next.errors();
  EXPECT_EQ(health_of(connect(next.addresses().front()), ""), 1);
}

TEST(Daemon, AFileThatIsNoSocketIsLeftAlone) {
  const test::TemporaryFolder folder;
  std::ofstream(folder / "precious") << "data";
  const RunResult result = run_sightlined(
      {"--sampler", "embree", "--listen", "none", "--listen-unix", folder / "precious"});
  EXPECT_GT(result.exit_code, 0);
  EXPECT_EQ(read_text(folder / "precious"), "data");
}

TEST(Daemon, AStepBudgetOfLessThanAMillisecondLowersTheQuality) {
  Daemon daemon({"--listen", "127.0.0.1:0", "--step-budget-ms", "0.001"});
  ASSERT_TRUE(daemon.wait_until_ready()) << daemon.errors();
  Stream stream(connect(daemon.addresses().front()));
  stream.open(open_with_boxes(2));
  bool degraded = false;
  for (uint64_t sequence = 1; sequence < 3000 && !degraded; ++sequence) {
    stream.send(move_tick(sequence, 1, 0.1));
    const auto reply = stream.read();
    ASSERT_TRUE(reply && reply->has_camera());
    degraded = reply->camera().flags().degraded();
  }
  EXPECT_TRUE(degraded);
}

// --- the end
// -----------------------------------------------------------------------------------------------------

TEST(Daemon, SigtermNotifiesOpenStreamsAnswersThemAndExitsWithZero) {
  Daemon daemon({"--listen", "127.0.0.1:0"});
  ASSERT_TRUE(daemon.wait_until_ready()) << daemon.errors();
  const auto channel = connect(daemon.addresses().front());
  Stream stream(channel);
  stream.open(open_with_boxes(2));
  daemon.signal(SIGTERM);
  const auto drain = stream.read();
  ASSERT_TRUE(drain && drain->has_drain());
  EXPECT_EQ(health_of(channel, ""), 2);
  EXPECT_FALSE(daemon.ready_file_exists());

  stream.send(move_tick(1, 1, 0.1));
  stream.half_close();
  const auto answer = stream.read();
  EXPECT_TRUE(answer && answer->has_camera());
  EXPECT_TRUE(stream.finish().ok());
  EXPECT_EQ(daemon.wait(), 0);
}

TEST(Daemon, AClientThatIgnoresTheDrainIsClosedAtTheDeadline) {
  Daemon daemon({"--listen", "127.0.0.1:0", "--drain-s", "0.1"});
  ASSERT_TRUE(daemon.wait_until_ready()) << daemon.errors();
  Stream stream(connect(daemon.addresses().front()));
  stream.open(open_with_boxes(2));
  daemon.signal(SIGINT);
  EXPECT_EQ(stream.finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(daemon.wait(), 0);
}

TEST(Daemon, ASecondSignalEndsTheWait) {
  Daemon daemon({"--listen", "127.0.0.1:0", "--drain-s", "3000"});
  ASSERT_TRUE(daemon.wait_until_ready()) << daemon.errors();
  Stream stream(connect(daemon.addresses().front()));
  stream.open(open_with_boxes(2));
  daemon.signal(SIGTERM);
  ASSERT_TRUE(stream.read()->has_drain());
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0);
}

TEST(Daemon, LogsJsonLinesThatNameTheSession) {
  Daemon daemon({"--listen", "127.0.0.1:0", "--log-format", "json"});
  ASSERT_TRUE(daemon.wait_until_ready()) << daemon.errors();
  std::string session;
  {
    Stream stream(connect(daemon.addresses().front()));
    v1::OpenSession open = open_with_boxes(2);
    open.set_label("arena \"one\"");
    session = stream.open(open).session_id();
    stream.half_close();
    EXPECT_TRUE(stream.finish().ok());
  }
  daemon.signal(SIGTERM);
  ASSERT_EQ(daemon.wait(), 0);
  std::istringstream lines(daemon.errors());
  bool opened = false, closed = false;
  for (std::string line; std::getline(lines, line);) {
    const nlohmann::json event = nlohmann::json::parse(line, nullptr, false);
    ASSERT_FALSE(event.is_discarded()) << line;
    if (event.value("session", "") != session) continue;
    opened |= event["message"] == "session opened" && event["label"] == "arena \"one\"";
    closed |= event["message"] == "session closed";
  }
  EXPECT_TRUE(opened);
  EXPECT_TRUE(closed);
}

}  // namespace
}  // namespace sightline
