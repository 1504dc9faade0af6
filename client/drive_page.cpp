#include "client/drive_page.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <unordered_map>

#include "client/contact_sheet.h"
#include "client/report.h"
#include "client/scenario_session.h"
#include "client/trace.h"

namespace sightline {
namespace {

// Names of the drawables that no actor is, by the id that `instantiate` gives them.
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

class Builder {
 public:
  Builder(const DrivePageInput& input, ScenarioWorld& world) : input_(input), world_(world) {}

  SessionPage build(const DrivePictures& pictures) {
    add_words();
    add_scene();
    for (size_t i = 0; i < input_.frames.size(); ++i)
      page_.frames.push_back(frame_of(input_.frames[i], input_.truths[i]));
    add_pictures(pictures);
    return std::move(page_);
  }

 private:
  void add_words() {
    const v1::SessionOpened& opened = input_.opened;
    page_.title = input_.open.label();
    page_.facts = {{"session", opened.session_id()},
                   {"sampler", opened.sampler()},
                   {"seed", std::to_string(input_.open.seed())},
                   {"preset", v1::Settings::Preset_Name(input_.open.settings().preset())},
                   {"instances", std::to_string(opened.instances())},
                   {"triangles", std::to_string(opened.triangles())}};
    for (const std::string& warning : opened.warnings()) page_.facts.emplace_back("warning", warning);
    page_.aspect = input_.scenario.lens().aspect;
    page_.body_radius_m = input_.limits.body_radius_m;
    page_.stages = {"scene", "bound", "sample", "aggregate", "move"};
    page_.flags = {"dt capped", "faces resampled", "body overlap"};
    if (!google::protobuf::util::MessageToJsonString(input_.open.settings(), &page_.settings_json).ok())
      page_.settings_json.clear();
    page_.columns = {"sightline"};
    if (input_.follow) page_.columns.emplace_back("follow");
    for (auto& rows : {figure_rows(input_.run, input_.follow), latency_rows(input_.frames)})
      for (const FigureRow& row : rows) {
        page_.figures.push_back({row.label, row.values});
        page_.figures.back().values.resize(page_.columns.size());
      }
  }

  void add_scene() {
    const auto names = asset_names(input_.scenario.asset());
    std::unordered_map<uint64_t, size_t> index;
    for (const Instance& instance : world_.mirror().instances()) {
      if (!instance.geometry || !instance.attributes.visible) continue;
      index[instance.id] = page_.instances.size();
      const auto named = names.find(instance.id);
      page_.instances.push_back({instance.id, named == names.end() ? "" : named->second, instance.geometry,
                                 instance.world_from_instance, instance.occludes()});
    }
    const std::vector<ScenarioActor>& actors = input_.scenario.actors();
    for (size_t i = 0; i < actors.size(); ++i) {
      const auto found = index.find(actors[i].id);
      if (actors[i].is_target)
        page_.targets.push_back({actors[i].id, actors[i].name, actors[i].weight, actors[i].required,
                                 found == index.end() ? -1 : static_cast<int>(found->second)});
      if (found == index.end()) continue;
      page_.instances[found->second].name = actors[i].name;
      const glm::dmat3& linear = world_.mirror().find(actors[i].id)->linear;
      page_.instances[found->second].world_from_instance =
          Affine(linear[0], linear[1], linear[2], glm::dvec3(0.0));
      page_.movers.push_back(found->second);
      mover_actors_.push_back(i);
    }
  }

  PageFrame frame_of(const PlayedFrame& played, const FrameTruth& truth) const {
    const v1::CameraReply& reply = played.reply;
    PageFrame frame;
    frame.sequence = reply.sequence();
    frame.time_s = played.frame.time_s;
    frame.camera = played.frame.camera;
    frame.vertical_fov_rad = played.frame.lens.vertical_fov_rad;
    frame.velocity_mps = {reply.velocity().x(), reply.velocity().y(), reply.velocity().z()};
    frame.counts = {reply.counts().all_visible(), reply.counts().some_visible(),
                    reply.counts().none_visible()};
    frame.status = name_of(reply.status());
    frame.reason = name_of(reply.reason());
    frame.text = reply.reason_text();
    frame.cut = reply.cut();
    frame.flags = (reply.flags().dt_capped() ? 1u : 0u) | (reply.flags().resampled_faces() ? 2u : 0u) |
                  (reply.flags().body_overlap() ? 4u : 0u);
    frame.merged_ticks = reply.merged_ticks();
    const v1::StageTimes& times = reply.stage_times();
    frame.queue_us = times.queue_us();
    frame.stage_us = {times.scene_us(), times.bound_us(), times.sample_us(), times.aggregate_us(),
                      times.move_us()};
    frame.latency_ms = played.latency_ms;
    frame.clearance_m = truth.body.clearance_m;
    const std::vector<Pose> poses = input_.scenario.poses_at(frame.time_s);
    for (const size_t actor : mover_actors_) frame.movers.push_back(poses[actor]);
    add_sights(reply, truth, poses, frame);
    add_cells(reply.candidates(), frame);
    return frame;
  }

  void add_sights(const v1::CameraReply& reply, const FrameTruth& truth, const std::vector<Pose>& poses,
                  PageFrame& frame) const {
    const std::vector<ScenarioActor>& actors = input_.scenario.actors();
    for (size_t i = 0; i < actors.size(); ++i) {
      if (!actors[i].is_target) continue;
      PageSight& sight = frame.sights.emplace_back();
      const Instance* instance = world_.mirror().find(actors[i].id);
      const glm::dvec3 center(instance->geometry->bounds.center());
      sight.aim_m = transform_point(poses[i], instance->linear * center);
      for (const v1::TargetVisibility& seen : reply.targets())
        if (seen.id() == actors[i].id) say(seen, sight);
      if (!truth.picture) continue;
      for (const TargetTruth& target : truth.picture->targets)
        if (target.id == actors[i].id) sight.true_share = target.visible_share();
    }
  }

  static void say(const v1::TargetVisibility& seen, PageSight& sight) {
    sight.visible_share = seen.visible_share();
    sight.filtered_share = seen.filtered_share();
    sight.state = v1::TargetState_Name(seen.state());
    sight.distance_m = seen.distance();
    if (seen.occluders().empty()) return;
    sight.occluder_id = seen.occluders(0).id();
    sight.occluder_share = seen.occluders(0).share();
  }

  // Nothing when they were not asked for: `chosen` would be 0.
  static void add_cells(const v1::Candidates& candidates, PageFrame& frame) {
    const int count = std::min(candidates.visible_mask_size(), candidates.position_size() / 3);
    for (int i = 0; i < count; ++i)
      frame.cells.push_back(
          {{candidates.position(3 * i), candidates.position(3 * i + 1), candidates.position(3 * i + 2)},
           candidates.visible_mask(i)});
    frame.chosen_cell = candidates.chosen() < count ? candidates.chosen() : -1;
  }

  void add_pictures(const DrivePictures& pictures) {
    const size_t frames = input_.frames.size(), count = std::min(pictures.count, frames);
    for (size_t k = 0; k < count; ++k) {
      const size_t frame = count == 1 ? 0 : (frames - 1) * k / (count - 1);
      const Picture picture = draw_frame(world_, input_.frames[frame].frame, pictures.width);
      page_.pictures.push_back({frame, "image/jpeg", encode_jpeg(picture, pictures.quality)});
      if (pictures.progress) pictures.progress(k + 1);
    }
  }

  const DrivePageInput& input_;
  ScenarioWorld& world_;
  std::vector<size_t> mover_actors_;  // by mover: index into the scenario's actors
  SessionPage page_;
};

}  // namespace

SessionPage drive_page(const DrivePageInput& input, ScenarioWorld& world, const DrivePictures& pictures) {
  return Builder(input, world).build(pictures);
}

}  // namespace sightline
