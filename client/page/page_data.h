// The numbers of a page: typed arrays one after another, deflated, in base64.
//
//   DATA = base64(zlib(array 0, padding to 8 bytes, array 1, ...)), little-endian;
//   directory = {name: [type, byte offset, element count], ...}, type one of "f64", "f32", "u32", "i32", "u16", "u8".
//
// client/page/web/session.js reads it.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace sightline {

class PageData {
 public:
  struct Entry {
    std::string type;
    size_t offset = 0;  // bytes
    size_t count = 0;   // elements
  };

  // Once for each name.
  template <typename T>
  void add(const std::string& name, const std::vector<T>& values) {
    add_bytes(name, type_name<T>(), std::as_bytes(std::span(values)), values.size());
  }
  const std::map<std::string, Entry>& directory() const { return directory_; }
  // Text of A-Z, a-z, 0-9, +, / and =.
  std::string encoded() const;

 private:
  template <typename T>
  static constexpr const char* type_name() {
    if constexpr (std::is_same_v<T, double>) return "f64";
    if constexpr (std::is_same_v<T, float>) return "f32";
    if constexpr (std::is_same_v<T, uint32_t>) return "u32";
    if constexpr (std::is_same_v<T, int32_t>) return "i32";
    if constexpr (std::is_same_v<T, uint16_t>) return "u16";
    if constexpr (std::is_same_v<T, uint8_t>) return "u8";
  }
  void add_bytes(const std::string& name, const char* type, std::span<const std::byte> bytes, size_t count);

  std::vector<uint8_t> bytes_;
  std::map<std::string, Entry> directory_;
};

// RFC 4648, with padding.
std::string to_base64(std::span<const uint8_t> bytes);

}  // namespace sightline
