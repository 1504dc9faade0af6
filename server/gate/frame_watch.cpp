#include "server/gate/frame_watch.h"

#include <algorithm>
#include <utility>

namespace sightline {
namespace {

constexpr std::string_view kPreface = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
// Calls that the server has ended and that are still known. Older ones receive nothing more that is under way.
constexpr size_t kEndedKnown = 1024;

}  // namespace

// Visitors of FrameReader::read.
struct FrameWatch::FromClient {
  FrameWatch& watch;
  const double now_s;

  bool begin(const FrameHead& head) {
    watch.begin_frame(head, now_s);
    return !watch.reason_;
  }
  void payload(std::span<const std::byte> part) {
    if (watch.stream_) watch.take_data(part);
  }
  bool end() {
    if (watch.stream_) watch.end_data(now_s);
    watch.end_by_client(watch.from_client_.head());
    return !watch.reason_ && watch.paced_calls_ == 0;
  }
};

struct FrameWatch::FromServer {
  FrameWatch& watch;
  const double now_s;

  bool begin(const FrameHead& head) {
    const bool wants_answer = head.type == FrameType::kHeaders || head.type == FrameType::kData ||
                              head.type == FrameType::kPing || head.type == FrameType::kSettings;
    if (wants_answer && !head.acknowledges()) watch.take_overhead(-watch.limits_.for_answer, now_s);
    return true;
  }
  void payload(std::span<const std::byte> part) {
    if (watch.from_server_.head().type == FrameType::kWindowUpdate)
      for (const std::byte byte : part) watch.increment_ = watch.increment_ << 8 | static_cast<uint32_t>(byte);
  }
  bool end() {
    const FrameHead& head = watch.from_server_.head();
    if (head.type == FrameType::kWindowUpdate) watch.grant(head.stream);
    if (head.type == FrameType::kRstStream || head.ends_stream()) watch.end_by_server(head.stream);
    return true;
  }
};

FrameWatch::FrameWatch(const FrameLimits& limits, std::shared_ptr<ClientFlow> client)
    : limits_(limits),
      client_(std::move(client)),
      calls_bucket_(limits.calls_burst, limits.calls_per_s),
      overhead_bucket_(limits.overhead_burst, limits.overhead_per_s),
      fair_calls_(limits.fair_burst, limits.fair_per_s),
      fair_overhead_(limits.fair_burst, limits.fair_per_s),
      preface_left_(kPreface.size()) {}

std::optional<std::string_view> FrameWatch::read(std::span<const std::byte> bytes, double now_s) {
  while (!bytes.empty() && !reason_) bytes = bytes.subspan(read_until_call(bytes, now_s));
  return reason_;
}

size_t FrameWatch::read_until_call(std::span<const std::byte> bytes, double now_s) {
  paced_calls_ = 0;
  const size_t preface = take_preface(bytes);
  if (reason_) return preface;
  FromClient visitor{*this, now_s};
  return preface + from_client_.read(bytes.subspan(preface), visitor);
}

void FrameWatch::read_answers(std::span<const std::byte> bytes, double now_s) {
  FromServer visitor{*this, now_s};
  from_server_.read(bytes, visitor);
}

// Returns the number of bytes that belong to it.
size_t FrameWatch::take_preface(std::span<const std::byte> bytes) {
  size_t at = 0;
  for (; preface_left_ > 0 && at < bytes.size() && !reason_; ++at, --preface_left_)
    if (static_cast<char>(bytes[at]) != kPreface[kPreface.size() - preface_left_])
      cut("it does not speak HTTP/2", false);
  return at;
}

// --- frames of the client

void FrameWatch::begin_frame(const FrameHead& head, double now_s) {
  greeted_ = true;
  stream_ = nullptr;
  if (head.length > limits_.max_frame_bytes) return cut("a frame is too long");
  const bool headers = head.type == FrameType::kHeaders || head.type == FrameType::kContinuation;
  if (headers || head.type == FrameType::kData) last_call_s_ = now_s;
  if (headers) begin_headers(head, now_s);
  if (head.type == FrameType::kData) stream_ = receiving(head);
  // What a frame of data costs is known at its end.
  if (!stream_) return take_overhead(overhead_of(head), now_s);
  completed_ = 0;
  change(*stream_, [](StreamMessages& messages) { messages.begin_frame(); });
}

void FrameWatch::begin_headers(const FrameHead& head, double now_s) {
  const bool first = head.type == FrameType::kHeaders;
  header_block_bytes_ = first ? head.length : header_block_bytes_ + head.length;
  if (header_block_bytes_ > limits_.max_header_block_bytes) return cut("the headers of a call are too long");
  if (head.ends_headers()) header_block_bytes_ = 0;
  const bool begins = first && head.stream > newest_stream_;
  const double free_bytes = first ? limits_.bytes_of_paced : 0.0;
  const double more = std::max(0.0, static_cast<double>(head.length) - free_bytes) / limits_.bytes_of_paced;
  paced_calls_ = std::min((begins ? 1.0 : 0.0) + more, limits_.paced_burst);
  if (begins) begin_call(head.stream, now_s);
}

void FrameWatch::begin_call(uint32_t id, double now_s) {
  newest_stream_ = id;
  ++calls_;
  take_call(now_s);
  take_overhead(-limits_.for_call, now_s);
  if (streams_.size() >= limits_.max_streams) return cut("it has too many calls at once");
  streams_.try_emplace(id);
}

// The call to which a frame of data belongs; null: none. gRPC ends a call that has padded frames.
FrameWatch::Stream* FrameWatch::receiving(const FrameHead& head) {
  const auto found = streams_.find(head.stream);
  if (found == streams_.end() || head.padded()) return nullptr;
  Stream& stream = found->second;
  if (stream.whole || (stream.over && ++stream.frames_after > limits_.frames_after_end)) return nullptr;
  return &stream;
}

void FrameWatch::take_data(std::span<const std::byte> payload) {
  change(*stream_, [&](StreamMessages& messages) { completed_ += messages.take(payload); });
}

void FrameWatch::end_data(double now_s) {
  const double kib = static_cast<double>(from_client_.head().length) / 1024.0;
  const bool carries = completed_ > 0 || from_client_.head().ends_stream();
  // It makes no room for other frames, since a message may be empty and a frame may hold thousands of them.
  take_overhead(carries ? 0.0 : std::max(0.0, 1.0 - kib * limits_.for_kib), now_s);
}

void FrameWatch::end_by_client(const FrameHead& head) {
  if (head.type == FrameType::kRstStream) return forget(head.stream);
  const auto found = head.ends_stream() ? streams_.find(head.stream) : streams_.end();
  if (found == streams_.end()) return;
  found->second.whole = true;
  if (found->second.over) forget(head.stream);
}

// --- frames of the server

void FrameWatch::grant(uint32_t id) {
  const auto found = streams_.find(id);
  if (found != streams_.end())
    change(found->second, [this](StreamMessages& messages) { messages.grant(increment_ & 0x7FFF'FFFFu); });
  increment_ = 0;
}

void FrameWatch::end_by_server(uint32_t id) {
  const auto found = streams_.find(id);
  if (found == streams_.end() || found->second.over) return;
  if (found->second.whole) return forget(id);
  held_bytes_ -= found->second.held_bytes();
  found->second.over = true;
  ended_.push_back(id);
  if (ended_.size() <= kEndedKnown) return;
  forget(ended_.front());
  ended_.pop_front();
}

// --- both

template <typename Change>
void FrameWatch::change(Stream& stream, const Change& change) {
  held_bytes_ -= stream.held_bytes();
  change(stream.messages);
  held_bytes_ += stream.held_bytes();
}

void FrameWatch::forget(uint32_t id) {
  const auto found = streams_.find(id);
  if (found == streams_.end()) return;
  if (stream_ == &found->second) stream_ = nullptr;
  held_bytes_ -= found->second.held_bytes();
  streams_.erase(found);
}

double FrameWatch::overhead_of(const FrameHead& head) const {
  return 1.0 + static_cast<double>(head.length) / limits_.bytes_of_overhead;
}

// All buckets are asked, so that each knows what passed.
void FrameWatch::take_call(double now_s) {
  const bool fair = fair_calls_.take(now_s), client = !client_ || client_->take_call(now_s);
  if (!calls_bucket_.take(now_s)) return cut("it opens calls too fast");
  if (!client && !fair) cut("its client opens calls too fast on all connections together");
}

void FrameWatch::take_overhead(double overhead, double now_s) {
  const bool fair = fair_overhead_.take(now_s, overhead), client = !client_ || client_->take_overhead(overhead, now_s);
  if (!overhead_bucket_.take(now_s, overhead))
    return cut("it resets calls, or sends frames that carry nothing, too fast");
  if (!client && !fair)
    cut("its client resets calls, or sends frames that carry nothing, too fast on all connections together");
}

// The first reason counts.
void FrameWatch::cut(std::string_view reason, bool flood) {
  if (reason_) return;
  reason_ = reason;
  flooded_ = flood;
}

}  // namespace sightline
