#include "client/drive/page.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <unordered_map>

#include "client/page/asset_names.h"
#include "client/page/contact_sheet.h"
#include "client/page/page_reply.h"
#include "client/drive/report.h"
#include "server/wire/short_name.h"

namespace sightline {
namespace {

class Builder {
 public:
  Builder(const DrivePageInput& input, ScenarioWorld& world) : input_(input), world_(world) {}

  SessionPage build(const DrivePictures& pictures) {
    add_words();
    add_scene();
    for (size_t i = 0; i < input_.frames.size(); ++i) add_frame(input_.frames[i], input_.truths[i]);
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
                   {"preset", short_name(input_.open.settings().preset())},
                   {"instances", std::to_string(opened.instance_count())},
                   {"triangles", std::to_string(opened.triangle_count())}};
    for (const std::string& warning : opened.warnings()) page_.facts.emplace_back("warning", warning);
    page_.aspect = input_.scenario.lens().aspect;
    page_.body_radius_m = input_.limits.body_radius_m;
    page_.stages = page_stages();
    page_.flags = page_flags();
    std::string& settings = page_.settings.emplace_back(PageSettings{"Settings as asked for", {}}).json;
    if (!google::protobuf::util::MessageToJsonString(input_.open.settings(), &settings).ok()) settings.clear();
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
        page_.targets.push_back({actors[i].id, actors[i].name, actors[i].weight, actors[i].required});
      if (found == index.end()) continue;
      page_.instances[found->second].name = actors[i].name;
      const glm::dmat3& linear = world_.mirror().find(actors[i].id)->linear;
      page_.instances[found->second].world_from_instance =
          Affine(linear[0], linear[1], linear[2], glm::dvec3(0.0));
      page_.movers.push_back({found->second, {}});
      mover_actors_.push_back(i);
    }
  }

  // The drive's own convention is the canonical one.
  void add_frame(const PlayedFrame& played, const FrameTruth& truth) {
    PageFrame frame = page_frame(played.reply, gltf_convention(), page_.aspect, page_.targets);
    frame.latency_ms = played.latency_ms;
    frame.clearance_m = truth.body.clearance_m;
    const std::vector<Pose> poses = input_.scenario.poses_at(frame.time_s);
    for (size_t i = 0; i < mover_actors_.size(); ++i) page_.movers[i].poses.push_back(poses[mover_actors_[i]]);
    add_truth(truth, poses, frame);
    add_page_cells(played.reply, gltf_convention(), page_.targets, frame);
    page_.frames.push_back(std::move(frame));
  }

  void add_truth(const FrameTruth& truth, const std::vector<Pose>& poses, PageFrame& frame) const {
    const std::vector<ScenarioActor>& actors = input_.scenario.actors();
    auto sight = frame.sights.begin();
    for (size_t i = 0; i < actors.size(); ++i) {
      if (!actors[i].is_target) continue;
      const Instance* instance = world_.mirror().find(actors[i].id);
      const glm::dvec3 center(instance->geometry->bounds.center());
      sight->aim_m = transform_point(poses[i], instance->linear * center);
      if (truth.picture)
        for (const TargetTruth& target : truth.picture->targets)
          if (target.id == actors[i].id) sight->true_share = target.visible_share();
      ++sight;
    }
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
