#include "server/service/session_recording.h"

#include <utility>

#include "server/base/hash.h"
#include "server/record/recorder.h"
#include "server/service/server_info.h"
#include "server/wire/memory_proto.h"

namespace sightline {
namespace {

bool is_wanted(const v1::RecordingRequest& request, bool all) {
  switch (request.mode()) {
    case v1::RecordingRequest::MODE_ON:
      return true;
    case v1::RecordingRequest::MODE_OFF:
      return false;
    default:
      return all;
  }
}

v1::RecordingInfo info_of(const v1::OpenSession& request, const v1::SessionOpened& opened) {
  v1::RecordingInfo info;
  info.set_server_version(kVersion);
  info.set_build(kBuild);
  info.set_sampler(opened.sampler());
  info.set_session_id(opened.session_id());
  info.set_seed(request.seed());
  if (request.has_convention()) *info.mutable_convention() = request.convention();
  info.set_label(request.label());
  return info;
}

std::string content_type_of(const SceneFile& file) {
  if (file.name.ends_with(".glb") || file.bytes->starts_with("glTF")) return "model/gltf-binary";
  if (file.name.ends_with(".gltf") || file.name.empty()) return "model/gltf+json";
  return "application/octet-stream";
}

// Calls `take` with every scene name or hash that the instances refer to. Names end in .glb or .gltf, hashes do not.
template <typename Take>
void for_each_mesh(const google::protobuf::RepeatedPtrField<v1::NewInstance>& instances, const Take& take) {
  for (const v1::NewInstance& instance : instances) {
    if (!instance.has_mesh()) continue;
    if (instance.mesh().has_scene_name()) take(instance.mesh().scene_name());
    if (instance.mesh().has_scene_hash()) take(instance.mesh().scene_hash());
  }
}

}  // namespace

SessionRecording::SessionRecording(const RecordingRules& rules, const StageClock& clock, SceneLibrary& scenes,
                                   const SceneReader& reader, const Log& log)
    : rules_(rules), clock_(clock), scenes_(scenes), reader_(reader), log_(log) {}

SessionRecording::~SessionRecording() = default;

void SessionRecording::close() {
  recorder_.reset();
}

void SessionRecording::open(const v1::OpenSession& request, const Session& session, int64_t arrival_ns,
                            v1::SessionOpened& opened) {
  session_id_ = opened.session_id();
  if (!is_wanted(request.recording(), rules_.all)) return;
  if (!rules_.writer) {
    if (request.recording().mode() == v1::RecordingRequest::MODE_ON)
      opened.add_warnings("recording: this server records no sessions (--record-dir)");
    return;
  }
  wall_from_clock_ns_ = static_cast<int64_t>(rules_.wall_ns()) - clock_();
  recorder_ = rules_.writer->open_session(info_of(request, opened));
  name_ = recorder_->file_name();
  // A file that cannot be made is not promised. The recorder keeps trying, and the log tells when it succeeds.
  if (const auto trouble = rules_.writer->folder_trouble())
    opened.add_warnings("recording: no file can be written at present: " + to_string(*trouble));
  else
    opened.set_recording_file(name_);
  const RecordTimes opened_at = times(arrival_ns);
  recorder_->show_level(std::make_shared<const LevelView>(
      level_view_of(session.mirror(), session.convention(), request, opened_at.log_ns)));
  recorder_->record(RecordTopic::kOpen, opened_at, request);
  attaches_ = rules_.attach_scenes || request.recording().attach_scenes();
  if (attaches_) attach_scenes(request, opened);
  recorder_->record(RecordTopic::kOpened, times(clock_()), opened);
  next_memory_ns_ = clock_() + static_cast<int64_t>(kMemoryEveryS * 1e9);
}

void SessionRecording::tick(const v1::Tick& tick, int64_t arrival_ns) {
  if (recorder_) recorder_->record(RecordTopic::kTick, times(arrival_ns), tick);
}

void SessionRecording::rejection(const v1::TickError& rejection) {
  if (recorder_) recorder_->record(RecordTopic::kTickError, times(clock_()), rejection);
}

void SessionRecording::reply(v1::CameraReply& reply) {
  if (!recorder_) return;
  if (recorder_->degraded()) reply.mutable_flags()->set_recording_degraded(true);
  recorder_->record(RecordTopic::kReply, times(clock_()), reply);
}

void SessionRecording::memory(const Session& session) {
  if (!recorder_) return;
  const int64_t now_ns = clock_();
  if (now_ns < next_memory_ns_ && !recorder_->wants_memory()) return;
  next_memory_ns_ = now_ns + static_cast<int64_t>(kMemoryEveryS * 1e9);
  memory_to_proto(session, memory_);
  recorder_->record(RecordTopic::kMemory, times(now_ns), memory_);
}

void SessionRecording::fault(uint64_t sequence, std::string_view stage, std::string_view message) noexcept try {
  if (!recorder_) return;
  v1::Fault fault;
  fault.set_sequence(sequence);
  fault.set_stage(std::string(stage));
  fault.set_message(std::string(message));
  recorder_->record(RecordTopic::kFault, times(clock_()), fault);
} catch (...) {
  // Memory has run out, which the log says.
}

bool SessionRecording::lacks_scenes(const v1::Tick& tick) const {
  if (!attaches_ || tick.delta().added_instances().empty()) return false;
  bool lacks = false;
  for_each_mesh(tick.delta().added_instances(),
                [&](const std::string& scene) { lacks |= !tried_scenes_.contains(scene); });
  return lacks;
}

void SessionRecording::attach_scenes(const v1::Tick& tick) {
  if (!attaches_ || tick.delta().added_instances().empty()) return;
  for_each_mesh(tick.delta().added_instances(), [&](const std::string& scene) { attach(scene); });
}

void SessionRecording::attach_scenes(const v1::OpenSession& request, v1::SessionOpened& opened) {
  const auto take = [&](const std::string& scene) {
    if (std::string warning = attach(scene); !warning.empty()) opened.add_warnings(std::move(warning));
  };
  if (request.scene().has_name()) take(request.scene().name());
  if (request.scene().has_hash()) take(request.scene().hash());
  for_each_mesh(request.instances(), take);
}

// Attaches the files that a replay needs to load the scene by the name or hash that the session used. Returns a
// warning, or an empty string.
std::string SessionRecording::attach(const std::string& scene) {
  if (!tried_scenes_.insert(scene).second) return {};
  ContentHash hash;
  const bool by_hash = from_hex(scene, hash);
  const auto files = by_hash ? scenes_.files_of(hash, reader_) : scenes_.files_of(scene);
  std::string trouble = files ? "" : to_string(files.error());
  for (size_t i = 0; files && i < files->size(); ++i) {
    const SceneFile& file = (*files)[i];
    const bool alone = by_hash && files->size() == 1;
    std::string name = alone ? "upload/" + to_hex(hash) : "scene/" + file.name;
    if (!attached_files_.insert(name).second) continue;  // two scenes refer to it
    if (!recorder_->attach(std::move(name), content_type_of(file), times(clock_()).log_ns, file.bytes))
      trouble = "the scene files of this session are too large together";
  }
  if (trouble.empty()) return {};
  log_.warn("scene not recorded", {{"session", session_id_}, {"scene", scene}, {"reason", trouble}});
  return "recording: the scene \"" + scene + "\" is not in it: " + trouble;
}

RecordTimes SessionRecording::times(int64_t clock_ns) const {
  const auto wall_ns = static_cast<uint64_t>(clock_ns + wall_from_clock_ns_);
  return {wall_ns, wall_ns};
}

}  // namespace sightline
