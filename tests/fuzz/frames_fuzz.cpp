// libFuzzer sends arbitrary bytes of HTTP/2 to the watch, first those of a client and then those of a server, in pieces
// whose sizes it chooses as well. The result must not depend on them.
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
  size_t held_bytes = 0;
  bool operator==(const Outcome&) const = default;
};

using Bytes = std::span<const std::byte>;

template <typename Take>
void in_pieces(Bytes bytes, size_t piece, const Take& take) {
  for (size_t at = 0; at < bytes.size(); at += piece)
    if (!take(bytes.subspan(at, std::min(piece, bytes.size() - at)))) return;
}

Outcome read_in_pieces(Bytes client, Bytes server, size_t piece) {
  FrameWatch watch;
  Outcome outcome;
  in_pieces(client, piece, [&](Bytes part) { return !(outcome.cut = watch.read(part, 1.0)); });
  if (!outcome.cut) in_pieces(server, piece, [&](Bytes part) { return watch.read_answers(part, 1.0), true; });
  outcome.calls = watch.calls();
  outcome.greeted = watch.greeted();
  // What a client sent before it was cut is held for a moment only, and depends on how far it came.
  outcome.held_bytes = outcome.cut ? 0 : watch.held_bytes();
  if (outcome.held_bytes > 1000 * (client.size() + 1)) std::abort();
  return outcome;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 3) return 0;
  const auto bytes = std::as_bytes(std::span(data + 2, size - 2));
  const Bytes client = bytes.first(bytes.size() * data[1] / 255), server = bytes.subspan(client.size());
  const Outcome whole = read_in_pieces(client, server, bytes.size());
  if (whole != read_in_pieces(client, server, 1) || whole != read_in_pieces(client, server, 1 + data[0])) std::abort();
  return 0;
}
