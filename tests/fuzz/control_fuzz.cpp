// libFuzzer plays a client of one session: an opening, ticks and scene deltas in any order, as bytes of the wire,
// without a network. The messages go the way that they go in the service: weighed, parsed, converted, applied, stepped,
// and answered. Depth maps come from Embree, or from a sampler that makes them up, so that steps are short and see
// anything.
//
// An input is a list of messages, each with its length (two bytes) before it. The first byte of all has options: 1
// prepares tables of the targets' extents. With 2, a session of two boxes is open already and the messages are ticks
// alone, whose sequence and time the target counts: hardly any input that the fuzzer changes at random still opens a
// session by itself. 4 takes the maps with Embree.

#include <cmath>
#include <cstdlib>
#include <string>

#include "server/sample/embree_sampler.h"
#include "server/service/session_budget.h"
#include "server/session/session.h"
#include "server/wire/from_proto.h"
#include "server/wire/message_weight.h"
#include "server/wire/to_proto.h"
#include "tests/fuzz/byte_feed.h"

namespace {

using namespace sightline;
using test::ByteFeed;

constexpr size_t kMostMemory = 4 << 20;
constexpr size_t kMostInstances = 200;
constexpr double kMostStepCostMs = 2.0;
// The fuzzer shall spend its time on messages rather than on steps.
constexpr int kMostSteps = 4;

// Gives each texel a distance and an occluder that follow from its place, some of them none.
class MadeUpSampler final : public Sampler {
 public:
  Status take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) override {
    maps.resize(requests.size());
    for (size_t i = 0; i < requests.size(); ++i) fill(mirror, requests[i], maps[i]);
    return {};
  }

 private:
  static void fill(const SceneMirror& mirror, const MapRequest& request, DepthMap& map) {
    const auto texels = static_cast<size_t>(request.view.width) * static_cast<size_t>(request.view.height);
    map.view = request.view, map.ahead_s = request.ahead_s;
    map.distance_m.assign(texels, std::numeric_limits<float>::infinity());
    map.occluder.assign(texels, kNoOccluder);
    const auto slots = static_cast<uint32_t>(mirror.instances().size());
    for (size_t t = 0; t < texels && slots > 0; ++t) {
      const auto slot = static_cast<uint32_t>(t * 7 % (2 * slots));
      if (slot >= slots || !mirror.instances()[slot].geometry || !mirror.instances()[slot].occludes()) continue;
      map.occluder[t] = slot;
      map.distance_m[t] = 0.5f + static_cast<float>(t % 9);
    }
  }
};

void must(bool holds) {
  if (!holds) std::abort();
}

bool all_finite(const google::protobuf::Message& message) {
  using Field = google::protobuf::FieldDescriptor;
  const auto& reflection = *message.GetReflection();
  std::vector<const Field*> fields;
  reflection.ListFields(message, &fields);
  for (const Field* field : fields) {
    const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      if (field->cpp_type() == Field::CPPTYPE_DOUBLE &&
          !std::isfinite(field->is_repeated() ? reflection.GetRepeatedDouble(message, field, i)
                                              : reflection.GetDouble(message, field)))
        return false;
      if (field->cpp_type() == Field::CPPTYPE_MESSAGE &&
          !all_finite(field->is_repeated() ? reflection.GetRepeatedMessage(message, field, i)
                                           : reflection.GetMessage(message, field)))
        return false;
    }
  }
  return true;
}

class Client {
 public:
  Client(bool with_tables, bool with_embree) : with_tables_(with_tables), with_embree_(with_embree) {}

  // Opens a session of two boxes, without bytes of the fuzzer.
  void open_usual() {
    v1::OpenSession request;
    request.mutable_camera()->mutable_position()->set_z(8.0);
    for (uint64_t id = 1; id <= 2; ++id) {
      v1::NewInstance& box = *request.add_instances();
      box.set_id(id);
      v1::Vec3& half = *box.mutable_shape()->mutable_box()->mutable_half_extent();
      half.set_x(0.2), half.set_y(0.5), half.set_z(0.2);
      box.mutable_pose()->mutable_position()->set_x(1.5 * static_cast<double>(id));
      request.add_targets()->set_id(id);
    }
    open(request);
    must(session_ != nullptr);
  }

  // Counts the tick by itself. False: the call has ended.
  bool send_next(v1::Tick request) {
    request.set_sequence(session_->sequence() + 1);
    request.set_time_s(static_cast<double>(request.sequence()) / 60.0);
    tick(request);
    return steps_ < kMostSteps;
  }

  // False: the call has ended.
  bool send(const v1::ControlRequest& request) {
    if (!session_) return request.has_open() && open(request.open());
    if (request.has_tick()) tick(request.tick());
    return steps_ < kMostSteps;
  }

 private:
  bool open(const v1::OpenSession& request) {
    std::vector<std::string> warnings;
    auto options = session_options_from_proto(request, {library_, store_}, warnings);
    if (!options) return refused(options.error(), nullptr, 0);
    if (options->instances.size() > kMostInstances) return false;
    const SessionLimits limits{.session_bytes = 0, .max_step_cost_ms = kMostStepCostMs};
    if (!check_step_cost(options->settings, options->targets, limits, "open.settings")) return false;
    if (with_tables_) options->extents = &extents_;
    auto opened = Session::open(std::move(*options), make_sampler(), nullptr);
    if (!opened) return refused(opened.error(), nullptr, 0);
    session_ = std::move(*opened);
    v1::SessionOpened reply;
    opened_to_proto(*session_, reply);
    must(reply.instance_count() == session_->mirror().size() && reply.mirror_hash() == session_->mirror().hash());
    return true;
  }

  std::unique_ptr<Sampler> make_sampler() const {
    static const auto embree = make_embree_sampler_device();
    return with_embree_ ? embree->make_sampler() : std::make_unique<MadeUpSampler>();
  }

  void tick(const v1::Tick& request) {
    const uint64_t revision = session_->mirror().revision(), hash = session_->mirror().hash(),
                   sequence = session_->sequence();
    auto input = tick_from_proto(request, *session_, {library_, store_});
    const bool too_much = input && over_budget(*input);
    const Status applied = !input ? tl::unexpected(input.error()) : too_much ? Status{} : session_->apply(*input);
    if (!applied || too_much) {
      if (!applied) refused(applied.error(), &session_->mirror(), request.sequence());
      must(session_->mirror().revision() == revision && session_->mirror().hash() == hash &&
           session_->sequence() == sequence);
      return;
    }
    must(session_->sequence() == request.sequence());
    ++applied_;
    if (!request.step_control().merge_into_next()) step(request);
  }

  bool over_budget(const TickInput& input) const {
    const StepSettings& settings = input.settings ? *input.settings : session_->settings();
    const std::vector<Target>& targets = input.targets ? *input.targets : session_->targets();
    const SessionLimits limits{.session_bytes = 0, .max_step_cost_ms = kMostStepCostMs};
    return session_->mirror().size() + input.delta.add.size() > kMostInstances ||
           !check_step_cost(settings, targets, limits, "tick");
  }

  void step(const v1::Tick& request) {
    ++steps_;
    const auto answer = session_->step(static_cast<int>(request.step_control().quality_level()));
    must(answer.has_value());
    must(answer->sequence == request.sequence() && answer->merged_ticks + 1 == applied_);
    must(answer->hash == session_->mirror().hash() && answer->revision == session_->mirror().revision());
    applied_ = 0;
    v1::CameraReply reply;
    camera_reply_to_proto(*answer, *session_, session_->diagnostics(), reply);
    // A map's distance is +infinity where there is no occluder.
    reply.clear_depth_maps();
    must(all_finite(reply));
    must(static_cast<size_t>(reply.targets_size()) == session_->targets().size());
    for (const v1::TargetVisibility& target : reply.targets())
      must(target.visible_share() >= 0 && target.visible_share() <= 1);
    std::string memory;
    session_->write_memory(memory);
    must(!memory.empty());
  }

  // Every refusal names a field and says why.
  bool refused(const Error& error, const SceneMirror* mirror, uint64_t sequence) {
    must(!error.field.empty() && !error.message.empty());
    v1::TickError told;
    tick_error_to_proto(error, sequence, mirror, told);
    must(told.sequence() == sequence && !told.message().empty());
    return false;
  }

  const bool with_tables_, with_embree_;
  GeometryStore store_;
  SceneLibrary library_{"", GltfLimits{}, store_};
  ExtentCache extents_;
  std::unique_ptr<Session> session_;
  uint32_t applied_ = 0;  // since the last step
  int steps_ = 0;
};

// Weighs the message before it is parsed, as the service does. False when it is too heavy or no message, and otherwise
// what `use` says.
template <typename Message, typename Use>
bool parsed(std::span<const uint8_t> bytes, const Use& use) {
  Message message;
  if (message_weight(*Message::descriptor(), std::as_bytes(bytes), kMostMemory) >= kMostMemory) return false;
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return false;
  // The weight is an upper estimate.
  must(message.SpaceUsedLong() <= 2 * kMostMemory);
  return use(message);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const bool quiet = [] {
    google::protobuf::SetLogHandler(nullptr);
    return true;
  }();
  (void)quiet;
  ByteFeed feed(data, size);
  const uint8_t options = feed.byte();
  Client client(options & 1, options & 4);
  if (options & 2) client.open_usual();
  while (!feed.empty()) {
    const auto bytes = feed.bytes(feed.take<uint16_t>());
    const bool goes_on = options & 2
                             ? parsed<v1::Tick>(bytes, [&](const v1::Tick& tick) { return client.send_next(tick); })
                             : parsed<v1::ControlRequest>(
                                   bytes, [&](const v1::ControlRequest& request) { return client.send(request); });
    if (!goes_on) break;
  }
  return 0;
}
