#include "server/service/log.h"

#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

namespace sightline {
namespace {

struct Lines {
  std::ostringstream text;
  Log log;
  explicit Lines(LogFormat format, LogLevel level = LogLevel::kDebug)
      : log(format, level, std::make_shared<spdlog::sinks::ostream_sink_mt>(text)) {}
  nlohmann::json json() const { return nlohmann::json::parse(text.str()); }
};

TEST(Log, WritesOneJsonObjectALine) {
  const Lines lines(LogFormat::kJson);
  lines.log.info("session opened", {{"session", "a-1"}, {"label", "two \"words\"\nand a line"}});
  const std::string text = lines.text.str();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1);
  EXPECT_EQ(lines.json()["message"], "session opened");
  EXPECT_EQ(lines.json()["level"], "info");
  EXPECT_EQ(lines.json()["session"], "a-1");
  EXPECT_EQ(lines.json()["label"], "two \"words\"\nand a line");
  EXPECT_TRUE(lines.json()["time"].get<std::string>().ends_with("Z"));
}

TEST(Log, ReplacesWhatIsNotUtf8) {
  const Lines lines(LogFormat::kJson);
  lines.log.info("x", {{"label", "\xff\xfe"}});
  EXPECT_EQ(lines.json()["label"], "\xEF\xBF\xBD\xEF\xBF\xBD");
}

TEST(Log, QuotesTextValuesThatWouldReadAsSeveral) {
  const Lines lines(LogFormat::kText);
  lines.log.warn("refused", {{"reason", "a b=c"}, {"code", "7"}, {"line", "x\ny"}, {"empty", ""}});
  EXPECT_TRUE(lines.text.str().ends_with(R"( refused reason="a b=c" code=7 line="x\ny" empty="")"
                                         "\n"))
      << lines.text.str();
}

TEST(Log, TextHoldsNoControlCharactersBeyondAscii) {
  const Lines lines(LogFormat::kText);
  lines.log.info("x", {{"csi", "\xC2\x9B" "31m"}, {"turned", "a\xE2\x80\xAE" "b"}, {"broken", "\x9B" "c"}});
  EXPECT_TRUE(lines.text.str().ends_with("x csi=\"\\u009b31m\" turned=\"a\\u202eb\" broken=\"\\ufffdc\"\n")) << lines.text.str();
}

TEST(Log, LeavesOutWhatIsLessSevereThanAsked) {
  const Lines lines(LogFormat::kText, LogLevel::kWarning);
  lines.log.info("quiet");
  EXPECT_EQ(lines.text.str(), "");
  lines.log.error("loud");
  EXPECT_NE(lines.text.str().find("loud"), std::string::npos);
}

}  // namespace
}  // namespace sightline
