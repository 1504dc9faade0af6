// What commands print for a person: columns, numbers that can be read, names that come from files.
#pragma once

#include <cstdint>
#include <cstdio>
#include <ostream>
#include <string>
#include <vector>

namespace sightline {

// As printf; at most 255 bytes.
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
// A name from a file: what would move the cursor is shown as '?', nothing as '-'.
std::string printable(const std::string& name, size_t longest = 40);
// "2023-11-14 22:13:20 UTC"; nanoseconds since 1970.
std::string utc_text(uint64_t time_ns);

// Columns as wide as their widest cell; numbers stand on the right.
class Table {
 public:
  struct Column {
    const char* title;
    bool number = false;
  };
  explicit Table(std::vector<Column> columns);
  // As many cells as there are columns.
  void row(std::vector<std::string> cells) { rows_.push_back(std::move(cells)); }
  void print(std::ostream& out) const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace sightline
