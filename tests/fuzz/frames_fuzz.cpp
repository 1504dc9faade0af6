// libFuzzer sends arbitrary bytes of HTTP/2 to the watch, in pieces whose sizes it chooses as well. The result must not depend on them.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <span>
#include <string_view>

#include "server/gate/frame_watch.h"

namespace {

using sightline::FrameWatch;

struct Outcome {
  std::optional<std::string_view> cut;
  uint64_t calls = 0;
  bool greeted = false;
  bool operator==(const Outcome&) const = default;
};

Outcome read_in_pieces(std::span<const std::byte> bytes, size_t piece) {
  FrameWatch watch;
  Outcome outcome;
  for (size_t at = 0; at < bytes.size() && !outcome.cut; at += piece)
    outcome.cut = watch.read(bytes.subspan(at, std::min(piece, bytes.size() - at)), 1.0);
  outcome.calls = watch.calls();
  outcome.greeted = watch.greeted();
  return outcome;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 2) return 0;
  const auto bytes = std::as_bytes(std::span(data + 1, size - 1));
  const Outcome whole = read_in_pieces(bytes, bytes.size());
  if (whole != read_in_pieces(bytes, 1) || whole != read_in_pieces(bytes, 1 + data[0])) std::abort();
  return 0;
}
