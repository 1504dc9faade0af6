#include "client/report/page.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <unordered_map>

#include "client/page/contact_sheet.h"
#include "client/page/page_reply.h"
#include "client/report/digest.h"
#include "client/report/instance_timeline.h"
#include "client/report/placeholders.h"
#include "client/truth/truth.h"
#include "server/scene/mirror.h"
#include "server/wire/settings_to_proto.h"

namespace sightline {
namespace {

constexpr size_t kMostTargets = 32;
constexpr int kJpegQuality = 82;

// Names of drawables without a binding, by the id that `instantiate` gives them. A node's GPU instances are numbered:
// "crate #2".
std::unordered_map<uint64_t, std::string> asset_names(const SceneAsset& asset) {
  std::unordered_map<uint64_t, std::string> names;
  uint64_t k = 0;
  for (const AssetNode& node : asset.nodes) {
    if (node.mesh < 0 || !asset.meshes[static_cast<size_t>(node.mesh)]) continue;
    const size_t count = std::max<size_t>(1, node.gpu_instances.size());
    for (size_t i = 0; i < count; ++i) {
      std::string& name = names[kAssetIdBit | k++] = node.name;
      if (count > 1) name.append(" #").append(std::to_string(i + 1));
    }
  }
  return names;
}

std::string seconds(double time_s) {
  std::string text = std::to_string(time_s);
  return text.erase(text.size() - 3).append(" s");
}

bool is_drawable(const PageFrame& frame) {
  return std::isfinite(frame.time_s) && is_finite(frame.camera.position_m) && is_finite(frame.camera.rotation) &&
         is_unit(frame.camera.rotation) && std::isfinite(frame.vertical_fov_rad);
}

// Applies a recording to a session, and makes the page from it.
class Maker {
 public:
  Maker(const Recording& recording, const RecordingPageOptions& options, SamplerDevice& sampler)
      : recording_(recording),
        options_(options),
        sampler_(sampler),
        occluders_(embree_, EmbreeScene::Content::kOccluders),
        colliders_(embree_, EmbreeScene::Content::kColliders),
        world_("", sampler),
        scenes_(recording, options.scenes) {}

  Result<SessionPage> make() {
    if (Status ok = open(); !ok) return tl::unexpected(ok.error());
    digest();
    if (digest_.frames == 0)
      return fail(ErrorCode::kNotFound, "recording", recording_.name() + ": no reply in this range");
    decide_on_cells();
    describe_terms(" at the start");
    page_.aspect = session_->session().lens().aspect;
    play();
    finish();
    if (page_.frames.empty())
      return fail(ErrorCode::kDataLoss, "recording", recording_.name() + ": no reply has a pose");
    return std::move(page_);
  }

 private:
  void notice(std::string text) { page_.notices.push_back(std::move(text)); }
  void progress(const char* what, size_t done, size_t of) const {
    if (options_.progress) options_.progress(what, done, of);
  }

  // ---- 1: the session as it was opened, with the scene files that are available ----

  Status open() {
    auto convention = convention_of(recording_.open_session());
    if (!convention) return tl::unexpected(convention.error());
    convention_ = *convention;
    scenes_.bring_to([this](std::span<const std::byte> bytes) { return world_.bring(bytes); });
    placeholders_.emplace(scenes_, convention_);
    return open_session();
  }

  Status open_session() {
    v1::OpenSession request = recording_.open_session();
    placeholders_->replace(request, false);
    auto session = LocalSession::open(request, world_);
    if (!session) {
      notice("The scene does not fit the session, which is shown without it: " + to_string(session.error()) + ".");
      placeholders_->replace(request, true);
      whole_scene_ = false;
      session = LocalSession::open(request, world_);
    }
    if (!session) return tl::unexpected(session.error());
    session_ = std::move(*session);
    const auto told = recording_.opened();
    whole_scene_ = whole_scene_ && placeholders_->missed().empty();
    if (whole_scene_ && told.mirror_hash() != 0 && told.mirror_hash() != session_->opened().mirror_hash()) {
      notice("The scene at hand is not the one that was recorded: shapes may differ from what the camera met.");
      whole_scene_ = false;
    }
    timeline_.emplace(names(request.scene()));
    return {};
  }

  // `scene` is the scene of the session in this process: by hash, or empty.
  std::unordered_map<uint64_t, std::string> names(const v1::SceneRef& scene) const {
    std::unordered_map<uint64_t, std::string> names;
    for (const auto& asset : world_.brought)
      if (to_hex(asset->hash) == scene.hash()) names = asset_names(*asset);
    for (const v1::NodeBinding& binding : recording_.open_session().scene().bindings())
      names[binding.id()] = binding.node();
    return names;
  }

  // ---- 2: what becomes frames ----

  void digest() {
    size_t replies = 0;
    for (const auto& [id, channel] : recording_.container().channels)
      if (const auto& counts = recording_.container().statistics.channel_message_counts;
          channel.topic == "/sightline/reply" && counts.contains(id))
        replies = counts.at(id);
    DigestOptions options{options_.range, std::max<size_t>(2, options_.max_frames), {}};
    options.progress = [&](size_t done) { progress("read", done, std::max(done, replies)); };
    digest_ = digest_recording(recording_, convention_, options);
    const size_t pictures = std::min(options_.pictures, digest_.frames);
    for (size_t k = 0; k < pictures; ++k)
      picture_frames_.insert(pictures == 1 ? 0 : (digest_.frames - 1) * k / (pictures - 1));
  }

  void decide_on_cells() {
    if (options_.cells == PageCells::kNone || digest_.has_candidates) return;
    std::string why;
    if (options_.cells == PageCells::kRecorded)
      why = "they were not recorded";
    else if (recording_.info().snapshot_ticks() > 0)
      why = "they were not recorded, and this file does not begin with its session";
    else if (!whole_scene_)
      why = "they were not recorded, and without the scene no step can be taken again";
    else if (recording_.info().sampler() != sampler_.kind())
      why = "they were not recorded, and the sampler " + recording_.info().sampler() + " is not to be had here";
    steps_again_ = why.empty();
    if (!why.empty()) notice("No candidate cells: " + why + ".");
    if (steps_again_) session_->want_candidates();
  }

  // ---- 3: tick by tick ----

  void play() {
    recording_.read({0.0, options_.range.end_s}, [this](RecordedEvent& event) {
      if (auto* tick = std::get_if<v1::Tick>(&event.message)) apply(*tick, event.log_ns);
      if (auto* rejection = std::get_if<v1::TickError>(&event.message)) refused_.insert(rejection->sequence());
      if (auto* reply = std::get_if<v1::CameraReply>(&event.message)) take(*reply, event.log_ns);
      return true;
    });
  }

  // A tick that was refused then should be refused now too; its recorded rejection stands after it in the file.
  void apply(v1::Tick& tick, uint64_t log_ns) {
    newest_tick_ = {tick.sequence(), log_ns};
    placeholders_->replace(tick);
    v1::TickError rejection;
    if (session_->apply(tick, rejection)) return;
    refused_now_.insert(tick.sequence());
    if (first_refusal_.empty()) first_refusal_ = rejection.message();
  }

  void take(v1::CameraReply& reply, uint64_t log_ns) {
    const bool in_range = log_ns >= digest_.first_log_ns && reply_ < digest_.kept.size();
    v1::CameraReply again;
    if (steps_again_) step_again(reply, again);
    if (!in_range) return progress("play", reply_, digest_.kept.size());
    if (digest_.kept[reply_++]) add_frame(reply, again, log_ns);
    progress(steps_again_ ? "step again" : "play", reply_, digest_.kept.size());
  }

  void step_again(const v1::CameraReply& reply, v1::CameraReply& again) {
    const Status stepped = session_->step(quality_level_of(reply), again);
    v1::Candidates cells;
    cells.Swap(again.mutable_candidates());
    again.clear_candidates();
    if (stepped && reply_hash(again) == reply_hash(reply)) {
      again.mutable_candidates()->Swap(&cells);
      return;
    }
    steps_again_ = false;
    again.Clear();
    notice("The steps taken again differ from the recording from tick " + std::to_string(reply.sequence()) +
           " on, at " + seconds(reply.time_s()) + ": no candidate cells after that.");
  }

  // ---- a frame ----

  void add_frame(const v1::CameraReply& reply, const v1::CameraReply& again, uint64_t log_ns) {
    const Session& session = session_->session();
    meet_targets(reply);
    PageFrame frame = page_frame(reply, session.convention(), session.lens().aspect, page_.targets);
    if (!is_drawable(frame)) return static_cast<void>(++without_pose_);
    if (!page_.frames.empty()) frame.time_s = std::max(frame.time_s, page_.frames.back().time_s);
    if (newest_tick_.first == reply.sequence() && log_ns >= newest_tick_.second)
      frame.latency_ms = static_cast<double>(log_ns - newest_tick_.second) * 1e-6;
    aim(frame);
    if (whole_scene_) measure_clearance(frame);
    if (options_.cells != PageCells::kNone)
      add_page_cells(digest_.has_candidates ? reply : again, session.convention(), page_.targets, frame);
    thin_cells(frame);
    timeline_->take_in(session.mirror(), page_.frames.size());
    if (picture_frames_.contains(page_.frames.size())) add_picture(frame);
    page_.frames.push_back(std::move(frame));
  }

  const Target* told(uint64_t id) const {
    for (const Target& target : session_->session().targets())
      if (target.instance_id == id) return &target;
    return nullptr;
  }

  void meet_targets(const v1::CameraReply& reply) {
    for (const v1::TargetVisibility& seen : reply.targets()) {
      auto known = std::find_if(page_.targets.begin(), page_.targets.end(),
                                [&](const PageTarget& t) { return t.id == seen.id(); });
      if (known == page_.targets.end()) {
        if (page_.targets.size() >= kMostTargets) {
          left_out_targets_.insert(seen.id());
          continue;
        }
        known = page_.targets.insert(known, {seen.id(), target_name(seen.id()), 1.0, true});
      }
      if (const Target* target = told(seen.id())) known->weight = target->weight, known->required = target->required;
      if (const Instance* instance = session_->session().mirror().find(seen.id())) known->radius_m = instance->radius_m;
    }
  }

  std::string target_name(uint64_t id) const {
    for (const v1::NodeBinding& binding : recording_.open_session().scene().bindings())
      if (binding.id() == id) return binding.node();
    return "target " + std::to_string(id);
  }

  void aim(PageFrame& frame) const {
    const SceneMirror& mirror = session_->session().mirror();
    for (size_t k = 0; k < page_.targets.size(); ++k) {
      const uint64_t id = page_.targets[k].id;
      const Instance* instance = mirror.find(id);
      const Target* target = told(id);
      glm::dvec3& aim_m = frame.sights[k].aim_m;
      if (!instance)
        aim_m = glm::dvec3(kPageUnknown);
      else if (target && target->aim_offset_m)
        aim_m = transform_point(instance->world_from_instance, *target->aim_offset_m);
      else
        aim_m = aim_point_m(*instance);
    }
  }

  // From the recorded camera to the nearest collider of the scene as it is in this frame.
  void measure_clearance(PageFrame& frame) {
    colliders_.take_in(session_->session().mirror());
    frame.clearance_m = colliders_.nearest_surface_m(frame.camera.position_m, BodyTruth::kReachM);
  }

  // Keeps the cells of every n-th frame. n doubles whenever a page would hold too many.
  void thin_cells(PageFrame& frame) {
    const auto forget = [](PageFrame& of) { of.cells = {}, of.chosen_cell = -1; };
    if (page_.frames.size() % cell_step_ != 0) return forget(frame);
    cells_ += frame.cells.size();
    while (cells_ > kMaxPageCells && cell_step_ < digest_.frames) {
      cell_step_ *= 2;
      cells_ = page_.frames.size() % cell_step_ == 0 ? frame.cells.size() : (forget(frame), 0);
      for (size_t i = 0; i < page_.frames.size(); ++i)
        if (i % cell_step_ != 0)
          forget(page_.frames[i]);
        else
          cells_ += page_.frames[i].cells.size();
    }
  }

  // Adds a picture of what the camera saw, and the true visible share of each target.
  void add_picture(PageFrame& frame) {
    const Session& session = session_->session();
    occluders_.take_in(session.mirror());
    std::vector<Target> targets;
    std::vector<size_t> colours;
    for (size_t k = 0; k < page_.targets.size(); ++k) {
      const Target* target = frame.sights[k].present ? told(page_.targets[k].id) : nullptr;
      if (!target || !session.mirror().slot_of(target->instance_id)) continue;
      targets.push_back(*target);
      colours.push_back(k);
    }
    CameraFrame camera{frame.time_s, frame.camera, session.lens()};
    camera.lens.vertical_fov_rad = frame.vertical_fov_rad;
    const PictureTruth truth = measure_picture(occluders_, session.mirror(), targets, camera.camera, camera.lens);
    for (size_t i = 0; whole_scene_ && i < targets.size(); ++i)
      if (truth.targets[i].alone_pixels > 0) frame.sights[colours[i]].true_share = truth.targets[i].visible_share();
    const Picture picture = draw_frame({session.mirror(), occluders_, targets, colours}, camera,
                                       options_.picture_width);
    page_.pictures.push_back({page_.frames.size(), "image/jpeg", encode_jpeg(picture, kJpegQuality)});
  }

  // ---- 4: words ----

  void describe_terms(const std::string& when) {
    const Session& session = session_->session();
    const auto lens = json_of(lens_to_proto(session.lens(), gltf_convention()));
    for (auto& [title, json] : {PageSettings{"Settings in effect", json_of(settings_to_proto(session.settings()))},
                                PageSettings{"Tuning in effect", json_of(tuning_to_proto(session.settings()))},
                                PageSettings{"Limits in effect", json_of(limits_to_proto(session.limits()))},
                                PageSettings{"Lens: radians, vertical", lens}}) {
      const auto same = [&, &json = json](const PageSettings& other) { return other.json == json; };
      if (std::none_of(page_.settings.begin(), page_.settings.end(), same))
        page_.settings.push_back({title + when, json});
    }
  }

  void finish() {
    const Session& session = session_->session();
    describe_terms(" at the end");
    page_.title = recording_.info().label().empty() ? recording_.info().session_id() : recording_.info().label();
    if (session.lens().aspect != page_.aspect)
      notice(
          "The shape of the picture changes in the session; all frames are shown in the one that it began "
          "with.");
    page_.body_radius_m = session.limits().body_radius_m;
    page_.clearance_reach_m = BodyTruth::kReachM;
    page_.stages = page_stages();
    page_.flags = page_flags();
    for (PageFrame& frame : page_.frames)
      while (frame.sights.size() < page_.targets.size()) frame.sights.emplace_back().present = false;
    timeline_->give(page_);
    add_marks();
    std::map<uint64_t, std::string> names;
    for (const PageTarget& target : page_.targets) names[target.id] = target.name;
    page_.columns = {"recording"};
    page_.figures = figures_of(digest_, names);
    page_.facts = facts_of(recording_, digest_);
    add_notices();
  }

  void add_marks() {
    if (page_.frames.empty()) return;
    std::vector<size_t> frames_before(digest_.kept.size() + 1, 0);
    for (size_t i = 0; i < digest_.kept.size(); ++i)
      frames_before[i + 1] = frames_before[i] + (digest_.kept[i] ? 1 : 0);
    for (const DigestMark& mark : digest_.marks) {
      const size_t frame = frames_before[std::min(mark.reply, digest_.kept.size())];
      page_.marks.push_back({std::min(frame, page_.frames.size() - 1), mark.kind, mark.text});
    }
  }

  void add_notices() {
    for (const std::string& missed : placeholders_->missed())
      notice("A scene file is missing; balls replace its instances, and nothing is occluded by it. " + missed + ".");
    for (std::string& text : notices_of(recording_, digest_)) notice(std::move(text));
    std::erase_if(refused_now_, [this](uint64_t sequence) { return refused_.contains(sequence); });
    if (!refused_now_.empty())
      notice(std::to_string(refused_now_.size()) +
             " ticks could not be applied here, though the server had taken them: " + first_refusal_ + ".");
    if (without_pose_ > 0) notice(std::to_string(without_pose_) + " replies have no pose that could be shown.");
    if (!left_out_targets_.empty())
      notice("Only the first 32 targets are shown; " + std::to_string(left_out_targets_.size()) + " more came up.");
  }

  const Recording& recording_;
  const RecordingPageOptions& options_;
  SamplerDevice& sampler_;
  EmbreeDevice embree_;
  EmbreeScene occluders_, colliders_;

  Convention convention_;
  LocalWorld world_;
  SceneFiles scenes_;
  std::optional<Placeholders> placeholders_;
  std::unique_ptr<LocalSession> session_;
  std::optional<InstanceTimeline> timeline_;
  bool whole_scene_ = true;  // false: occlusion is not as it was

  RecordingDigest digest_{Convention{}};
  std::set<size_t> picture_frames_;
  bool steps_again_ = false;
  std::pair<uint64_t, uint64_t> newest_tick_;  // its sequence and its log time
  size_t reply_ = 0;                           // index of the next reply of the range
  std::set<uint64_t> refused_, refused_now_, left_out_targets_;
  std::string first_refusal_;
  size_t without_pose_ = 0, cells_ = 0, cell_step_ = 1;
  SessionPage page_;
};

}  // namespace

Result<SessionPage> recording_page(const Recording& recording, const RecordingPageOptions& options,
                                   SamplerDevice& sampler) {
  return Maker(recording, options, sampler).make();
}

}  // namespace sightline
