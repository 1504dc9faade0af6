#include "client/bench/protocol.h"

#include <grpcpp/impl/codegen/proto_utils.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "client/cpp/sightline_client.h"

namespace sightline {
namespace {

template <typename Message>
void to_bytes(const Message& message, grpc::ByteBuffer& bytes) {
  bool owned = false;
  grpc::SerializationTraits<Message>::Serialize(message, &bytes, &owned);
}

BenchAnswer opened(const v1::SessionOpened& session) {
  return {.kind = BenchAnswer::Kind::kOpened,
          .opened = {session.sampler(), session.instance_count(), session.triangle_count()}};
}

BenchAnswer answer(const v1::CameraReply& camera) {
  const v1::StageTimes& t = camera.stage_times();
  return {.kind = BenchAnswer::Kind::kReply,
          .sequence = camera.sequence(),
          .merged = camera.merged_ticks(),
          .stages_us = {{t.queue_us(), t.scene_us(), t.bound_us(), t.sample_us(), t.aggregate_us(), t.move_us(),
                         t.total_us()}},
          .degraded = camera.flags().degraded()};
}

BenchAnswer read_reply(grpc::ByteBuffer& message, v1::ControlResponse& reply) {
  if (!grpc::SerializationTraits<v1::ControlResponse>::Deserialize(&message, &reply).ok())
    return {.trouble = "a reply that is no ControlResponse"};
  if (reply.has_opened()) return opened(reply.opened());
  if (reply.has_camera()) return answer(reply.camera());
  if (reply.has_tick_error())
    return {.kind = BenchAnswer::Kind::kRejection,
            .sequence = reply.tick_error().sequence(),
            .trouble = to_string(to_error(reply.tick_error()))};
  if (reply.has_drain()) return {.trouble = "the server is going away: " + reply.drain().reason()};
  return {};
}

}  // namespace

BenchProtocol control_protocol(const BenchWorld& world, size_t session, const v1::OpenSession& open) {
  BenchProtocol protocol;
  protocol.method = "/sightline.v1.CameraControlService/Control";
  // Kept for their memory; one is used by the sending thread, the other by the reading thread.
  const auto request = std::make_shared<v1::ControlRequest>();
  const auto reply = std::make_shared<v1::ControlResponse>();
  *request->mutable_open() = open;
  to_bytes(*request, protocol.opening.emplace());
  protocol.write_tick = [&world, session, request](uint64_t sequence, grpc::ByteBuffer& message) {
    world.fill_tick(session, sequence, *request->mutable_tick());
    to_bytes(*request, message);
  };
  protocol.read = [reply](grpc::ByteBuffer& message) { return read_reply(message, *reply); };
  return protocol;
}

BenchProtocol echo_protocol(std::function<MessageSizes()> sizes) {
  BenchProtocol protocol;
  protocol.method = kEchoMethod;
  protocol.write_tick = [sizes = std::move(sizes)](uint64_t sequence, grpc::ByteBuffer& message) {
    const MessageSizes size = sizes();
    write_echo({sequence, size.reply}, size.tick, message);
  };
  protocol.read = [](grpc::ByteBuffer& message) -> BenchAnswer {
    const auto header = read_echo(message);
    if (!header) return {.trouble = "an echo without a header"};
    return {.kind = BenchAnswer::Kind::kReply, .sequence = header->sequence};
  };
  return protocol;
}

void write_echo(const EchoHeader& header, size_t size, grpc::ByteBuffer& message) {
  const grpc::Slice slice(grpc_slice_malloc(std::max(size, sizeof header)), grpc::Slice::STEAL_REF);
  std::memcpy(const_cast<uint8_t*>(slice.begin()), &header, sizeof header);
  message = grpc::ByteBuffer(&slice, 1);
}

std::optional<EchoHeader> read_echo(const grpc::ByteBuffer& message) {
  grpc::Slice bytes;
  EchoHeader header;
  if (message.Length() < sizeof header || !message.DumpToSingleSlice(&bytes).ok()) return std::nullopt;
  std::memcpy(&header, bytes.begin(), sizeof header);
  return header;
}

}  // namespace sightline
