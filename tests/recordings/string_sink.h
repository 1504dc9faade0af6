// A sink whose bytes outlive the writer that owns it.
#pragma once

#include <string>
#include <string_view>

#include "server/record/byte_io.h"

namespace sightline::test {

class StringSink final : public ByteSink {
 public:
  explicit StringSink(std::string& out) : out_(out) {}
  Status write(std::string_view bytes) override {
    out_.append(bytes);
    return {};
  }

 private:
  std::string& out_;
};

}  // namespace sightline::test
