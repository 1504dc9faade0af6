// Texts for people: numbers, names, tables, the progress bar.
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "client/base/progress_bar.h"
#include "client/base/text_table.h"

namespace sightline {
namespace {

TEST(Text, NumbersAreReadable) {
  EXPECT_EQ(grouped(0), "0");
  EXPECT_EQ(grouped(999), "999");
  EXPECT_EQ(grouped(1000), "1,000");
  EXPECT_EQ(grouped(1234567), "1,234,567");
  EXPECT_EQ(bytes_text(1536), "1.5 KiB");
  EXPECT_EQ(bytes_text(12u << 20), "12.0 MiB");
  EXPECT_EQ(utc_text(1'700'000'000'000'000'000), "2023-11-14 22:13:20 UTC");
}

TEST(Text, NamesFromFilesAreMadeSafe) {
  EXPECT_EQ(printable("wall\n\x1b[2J"), "wall??[2J");
  EXPECT_EQ(printable(""), "-");
  EXPECT_EQ(printable("abcdef", 6), "abcdef");
  EXPECT_LE(printable(std::string(100, 'x')).size(), 40u);
}

TEST(Text, ColumnsOfATableAreAsWideAsTheirWidestCell) {
  Table table({{"name"}, {"triangles", true}});
  table.row({"a", "5"});
  table.row({"a long name", "1,000,000"});
  std::ostringstream out;
  table.print(out);
  std::istringstream lines(out.str());
  std::string head, first, second;
  std::getline(lines, head), std::getline(lines, first), std::getline(lines, second);
  EXPECT_EQ(head.find("triangles"), second.find("1,000,000"));
  EXPECT_EQ(first.size(), second.size()) << "numbers end in one column";
  EXPECT_EQ(first.back(), '5');
}

TEST(ProgressBarTest, IsDrawnWhenItChangesAndErasedOnce) {
  std::ostringstream out;
  ProgressBar bar(out, true);
  bar.show("replay", 1, 4);
  const std::string drawn = out.str();
  EXPECT_EQ(drawn, "\rreplay     [##########..............................]  25 %");
  bar.show("replay", 1, 4);
  EXPECT_EQ(out.str(), drawn) << "nothing new";
  bar.show("report", 1, 4);
  EXPECT_GT(out.str().size(), drawn.size());
  out.str("");
  bar.clear();
  EXPECT_EQ(out.str(), "\r\x1b[K");
  bar.clear();
  EXPECT_EQ(out.str(), "\r\x1b[K") << "there is nothing left to erase";
  bar.show("replay", 0, 0);
  EXPECT_NE(out.str().find("100 %"), std::string::npos) << "nothing to do is done";
}

TEST(ProgressBarTest, AtItsBeginningIsErasedToo) {
  std::ostringstream out;
  ProgressBar bar(out, true);
  bar.show("replay", 0, 4);
  out.str("");
  bar.clear();
  EXPECT_EQ(out.str(), "\r\x1b[K");
}

TEST(ProgressBarTest, IsNotDrawnIntoAFile) {
  std::ostringstream out;
  {
    ProgressBar bar(out, false);
    bar.show("replay", 1, 4);
  }
  EXPECT_EQ(out.str(), "");
}

}  // namespace
}  // namespace sightline
