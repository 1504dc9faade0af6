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
  lines.log.info("x", {{"csi",
                        "\xC2\x9B"
                        "31m"},
                       {"turned",
                        "a\xE2\x80\xAE"
                        "b"},
                       {"broken",
                        "\x9B"
                        "c"}});
  EXPECT_TRUE(lines.text.str().ends_with("x csi=\"\\u009b31m\" turned=\"a\\u202eb\" broken=\"\\ufffdc\"\n"))
      << lines.text.str();
}

// A code point as UTF-8, by the definition of RFC 3629.
std::string utf8(uint32_t point) {
  const auto tail = [&](int shift) { return static_cast<char>(0x80 | ((point >> shift) & 0x3F)); };
  if (point < 0x80) return {static_cast<char>(point)};
  if (point < 0x800) return {static_cast<char>(0xC0 | (point >> 6)), tail(0)};
  if (point < 0x10000) return {static_cast<char>(0xE0 | (point >> 12)), tail(6), tail(0)};
  return {static_cast<char>(0xF0 | (point >> 18)), tail(12), tail(6), tail(0)};
}

TEST(Log, BothFormatsHoldEveryCodePointInPrintableAscii) {
  constexpr uint32_t kPoints = 0x110000, kInOneLine = 256;
  for (uint32_t first = 0; first < kPoints; first += kInOneLine) {
    if (first >= 0xD800 && first < 0xE000) continue;  // surrogates, which no UTF-8 has
    std::string label;
    for (uint32_t point = first; point < first + kInOneLine; ++point) label += utf8(point);
    const Lines json(LogFormat::kJson), text(LogFormat::kText);
    json.log.info("x", {{"label", label}});
    text.log.info("x", {{"label", label}});
    const std::string line = json.text.str(), plain = text.text.str();
    ASSERT_TRUE(std::all_of(line.begin(), line.end() - 1, [](char c) { return c >= ' ' && c <= '~'; })) << first;
    ASSERT_EQ(json.json()["label"], label) << first;
    // The value, with its quotes, is the same.
    const size_t in_json = line.find("\"label\":") + 8, in_text = plain.find("label=") + 6;
    ASSERT_EQ(line.substr(in_json, line.size() - in_json - 2), plain.substr(in_text, plain.size() - in_text - 1))
        << first;
  }
}

TEST(Log, BothFormatsReplaceWhatIsNotUtf8Alike) {
  for (const char* broken : {"\x9B", "a\xC2", "\xE2\x80", "\xED\xA0\x80", "\xC0\xAF", "\xF5\x80\x80\x80", "\xFE\xFF"}) {
    const Lines json(LogFormat::kJson), text(LogFormat::kText);
    json.log.info("x", {{"label", broken}});
    text.log.info("x", {{"label", broken}});
    const std::string line = json.text.str(), plain = text.text.str();
    EXPECT_NE(line.find("\\ufffd"), std::string::npos) << line;
    EXPECT_TRUE(std::all_of(line.begin(), line.end() - 1, [](char c) { return c >= ' ' && c <= '~'; }));
    EXPECT_EQ(line.substr(line.find("\"label\":") + 8),
              plain.substr(plain.find("label=") + 6, plain.size() - plain.find("label=") - 7) + "}\n");
  }
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
