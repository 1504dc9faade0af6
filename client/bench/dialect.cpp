#include "client/bench/dialect.h"

#include <grpcpp/impl/codegen/proto_utils.h>

#include <algorithm>
#include <vector>

#include "client/bench/echo.h"
#include "client/cpp/sightline_client.h"

namespace sightline {
namespace {

template <typename Message>
void to_bytes(const Message& message, grpc::ByteBuffer& bytes) {
  bool owned = false;
  grpc::SerializationTraits<Message>::Serialize(message, &bytes, &owned);
}

BenchStages stages_of(const v1::StageTimes& times) {
  return {times.queue_us(),     times.scene_us(), times.bound_us(), times.sample_us(),
          times.aggregate_us(), times.move_us(),  times.total_us()};
}

class ControlDialect final : public BenchDialect {
 public:
  ControlDialect(const BenchWorld& world, size_t session, v1::OpenSession open)
      : world_(world), session_(session), open_(std::move(open)) {}

  std::string method() const override { return "/sightline.v1.CameraControlService/Control"; }

  bool opening(grpc::ByteBuffer& message) override {
    v1::ControlRequest request;
    request.mutable_open()->Swap(&open_);
    to_bytes(request, message);
    return true;
  }

  void tick(uint64_t sequence, grpc::ByteBuffer& message) override {
    world_.fill_tick(session_, sequence, *request_.mutable_tick());
    to_bytes(request_, message);
  }

  BenchAnswer read(grpc::ByteBuffer& message) override {
    if (!grpc::SerializationTraits<v1::ControlResponse>::Deserialize(&message, &reply_).ok())
      return {.trouble = "a reply that is no ControlResponse"};
    switch (reply_.message_case()) {
      case v1::ControlResponse::kOpened:
        return opened(reply_.opened());
      case v1::ControlResponse::kCamera:
        return answer(reply_.camera());
      case v1::ControlResponse::kTickError:
        return {.kind = BenchAnswer::Kind::kRejection,
                .sequence = reply_.tick_error().sequence(),
                .trouble = to_string(to_error(reply_.tick_error()))};
      case v1::ControlResponse::kDrain:
        return {.trouble = "the server is going away: " + reply_.drain().reason()};
      case v1::ControlResponse::MESSAGE_NOT_SET:
        break;
    }
    return {};
  }

 private:
  static BenchAnswer opened(const v1::SessionOpened& session) {
    return {.kind = BenchAnswer::Kind::kOpened,
            .opened = {session.sampler(), session.instance_count(), session.triangle_count()}};
  }
  static BenchAnswer answer(const v1::CameraReply& camera) {
    return {.kind = BenchAnswer::Kind::kReply,
            .sequence = camera.sequence(),
            .merged = camera.merged_ticks(),
            .stages = stages_of(camera.stage_times()),
            .degraded = is_degraded(camera.flags())};
  }

  const BenchWorld& world_;
  const size_t session_;
  v1::OpenSession open_;
  v1::ControlRequest request_;  // by the sending thread
  v1::ControlResponse reply_;      // by the reading one
};

class EchoDialect final : public BenchDialect {
 public:
  explicit EchoDialect(const BenchStream& twin) : twin_(twin) {}

  std::string method() const override { return kEchoMethod; }
  bool opening(grpc::ByteBuffer&) override { return false; }

  void tick(uint64_t sequence, grpc::ByteBuffer& message) override {
    bytes_.resize(std::max(kEchoHeaderBytes, twin_.last_tick_bytes()));
    write_echo_header({sequence, static_cast<uint32_t>(twin_.last_reply_bytes())}, bytes_.data());
    const grpc::Slice slice(bytes_.data(), bytes_.size());
    message = grpc::ByteBuffer(&slice, 1);
  }

  BenchAnswer read(grpc::ByteBuffer& message) override {
    uint8_t sequence[8];
    if (!first_bytes(message, sizeof sequence, sequence)) return {.trouble = "an echo without a sequence"};
    return {.kind = BenchAnswer::Kind::kReply, .sequence = sequence_of(sequence)};
  }

 private:
  const BenchStream& twin_;
  std::vector<uint8_t> bytes_;
};

}  // namespace

std::unique_ptr<BenchDialect> control_dialect(const BenchWorld& world, size_t session, v1::OpenSession open) {
  return std::make_unique<ControlDialect>(world, session, std::move(open));
}

std::unique_ptr<BenchDialect> echo_dialect(const BenchStream& twin) {
  return std::make_unique<EchoDialect>(twin);
}

// By name, so that it works with every version of the protocol that has the flag.
bool is_degraded(const v1::StepFlags& flags) {
  static const google::protobuf::FieldDescriptor* const field =
      v1::StepFlags::descriptor()->FindFieldByName("degraded");
  if (!field) return false;
  const google::protobuf::Reflection& read = *flags.GetReflection();
  return field->message_type() ? read.HasField(flags, field)
                               : field->cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_BOOL &&
                                     read.GetBool(flags, field);
}

}  // namespace sightline
