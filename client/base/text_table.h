// Text for people: tables, readable numbers, and names from files made safe to print.
#pragma once

#include <cstdint>
#include <cstdio>
#include <ostream>
#include <string>
#include <vector>

namespace sightline {

// Like printf; longer texts are cut to 255 bytes.
template <typename... Values>
std::string formatted(const char* format, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

// 1234567 -> "1,234,567"
std::string grouped(uint64_t value);
// "1.5 KiB", "12.0 MiB"
std::string bytes_text(uint64_t bytes);
// A name from a file, cut to `longest` bytes: control characters become '?', and an empty name becomes '-'.
std::string printable(const std::string& name, size_t longest = 40);
// Nanoseconds since 1970 as "2023-11-14 22:13:20 UTC".
std::string utc_text(uint64_t time_ns);

// A table whose columns are as wide as their widest cell. Numbers are right-aligned.
class Table {
 public:
  struct Column {
    const char* title;
    bool number = false;
  };
  explicit Table(std::vector<Column> columns);
  // `cells` has one entry for each column.
  void row(std::vector<std::string> cells) { rows_.push_back(std::move(cells)); }
  void print(std::ostream& out) const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace sightline
