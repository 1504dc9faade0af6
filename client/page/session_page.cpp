#include "client/page/session_page.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <unordered_map>
#include <unordered_set>

#include "client/page/page_data.h"
#include "client/page/page_template.h"

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kMaxTargets = 32, kMaxFlags = 32;

// 64 bits do not fit a number of JavaScript's.
std::string id_text(uint64_t id) {
  return std::to_string(id);
}

std::string at(const char* list, size_t i, const char* member = "") {
  return std::string(list).append("[").append(std::to_string(i)).append("]").append(member);
}

// ---- limits of a page's input ----

Status check_frame(const SessionPage& session, size_t i) {
  const PageFrame& frame = session.frames[i];
  if (frame.sights.size() != session.targets.size())
    return invalid(at("frames", i, ".sights"), "must be as long as targets");
  if (frame.stage_us.size() != session.stages.size())
    return invalid(at("frames", i, ".stage_us"), "must be as long as stages");
  if (frame.chosen_cell >= static_cast<int>(frame.cells.size()))
    return invalid(at("frames", i, ".chosen_cell"), "is none of its cells");
  if (frame.shot && !is_finite(frame.shot->place_m))
    return invalid(at("frames", i, ".shot"), "has a place that is not finite");
  if (!std::isfinite(frame.time_s) || !is_finite(frame.camera.position_m) || !is_finite(frame.camera.rotation))
    return invalid(at("frames", i), "has a time or a camera that is not finite");
  if (i > 0 && frame.time_s < session.frames[i - 1].time_s) return invalid(at("frames", i, ".time_s"), "goes back");
  return {};
}

// The frames of an instance's life, clipped to the session's frames.
std::pair<size_t, size_t> life_of(const PageInstance& instance, const SessionPage& session) {
  const size_t end = std::min(instance.end_frame, session.frames.size());
  return {std::min(instance.first_frame, end), end};
}

Status check_mover(const SessionPage& session, size_t i, std::unordered_set<size_t>& moving) {
  const PageMover& mover = session.movers[i];
  if (mover.instance >= session.instances.size()) return invalid(at("movers", i), "is no instance");
  if (!moving.insert(mover.instance).second) return invalid(at("movers", i), "moves twice");
  const auto [first, end] = life_of(session.instances[mover.instance], session);
  if (mover.poses.size() != end - first)
    return invalid(at("movers", i, ".poses"), "must be as long as its instance's life");
  return {};
}

Status check(const SessionPage& session) {
  if (session.frames.empty()) return invalid("frames", "a page needs one at least");
  if (!(session.aspect > 0.0) || !std::isfinite(session.aspect)) return invalid("aspect", "must be above 0");
  if (session.targets.size() > kMaxTargets) return invalid("targets", "more than 32");
  if (session.flags.size() > kMaxFlags) return invalid("flags", "more than 32");
  for (size_t i = 0; i < session.instances.size(); ++i)
    if (!session.instances[i].geometry) return invalid(at("instances", i, ".geometry"), "is missing");
  std::unordered_set<size_t> moving;
  for (size_t i = 0; i < session.movers.size(); ++i)
    if (Status ok = check_mover(session, i, moving); !ok) return ok;
  for (size_t i = 0; i < session.marks.size(); ++i)
    if (session.marks[i].frame >= session.frames.size()) return invalid(at("marks", i, ".frame"), "is no frame");
  for (size_t i = 0; i < session.pictures.size(); ++i)
    if (session.pictures[i].frame >= session.frames.size()) return invalid(at("pictures", i, ".frame"), "is no frame");
  for (size_t i = 0; i < session.figures.size(); ++i)
    if (session.figures[i].values.size() != session.columns.size())
      return invalid(at("figures", i, ".values"), "must be as long as columns");
  for (size_t i = 0; i < session.frames.size(); ++i)
    if (Status ok = check_frame(session, i); !ok) return ok;
  return {};
}

// ---- the scene ----

// The meshes of a page, each once.
class Meshes {
 public:
  size_t index_of(const Geometry& geometry) {
    const auto [entry, is_new] = index_.emplace(&geometry, index_.size());
    if (is_new) add(geometry);
    return entry->second;
  }
  void write(Json& page, PageData& data) const {
    page["meshes"] = list_;
    data.add("mesh_positions", positions_);
    data.add("mesh_indices", indices_);
  }

 private:
  void add(const Geometry& geometry) {
    const glm::vec3 low = geometry.indices.empty() ? glm::vec3(0.0f) : geometry.bounds.min;
    const glm::vec3 high = geometry.indices.empty() ? glm::vec3(0.0f) : geometry.bounds.max;
    const glm::vec3 step = (high - low) / 65535.0f;
    list_.push_back({{"first_vertex", positions_.size() / 3},
                     {"vertices", geometry.positions.size()},
                     {"first_index", indices_.size()},
                     {"indices", geometry.indices.size()},
                     {"low", {low.x, low.y, low.z}},
                     {"step", {step.x, step.y, step.z}}});
    for (const glm::vec3& p : geometry.positions)
      for (int axis = 0; axis < 3; ++axis) positions_.push_back(quantized(p[axis], low[axis], step[axis]));
    // Differences compress to a fraction of what indices do.
    int64_t before = 0;
    for (const uint32_t index : geometry.indices) {
      indices_.push_back(static_cast<int32_t>(index - before));
      before = index;
    }
  }
  // A position that no triangle uses may lie outside the bounds.
  static uint16_t quantized(float value, float low, float step) {
    if (!(step > 0.0f)) return 0;
    return static_cast<uint16_t>(std::lround(std::clamp((value - low) / step, 0.0f, 65535.0f)));
  }

  std::unordered_map<const Geometry*, size_t> index_;
  Json list_ = Json::array();
  std::vector<uint16_t> positions_;
  std::vector<int32_t> indices_;
};

void write_scene(const SessionPage& session, Json& page, PageData& data) {
  Meshes meshes;
  std::vector<float> transforms;  // columns x, y, z, origin
  Json instances = Json::array();
  for (const PageInstance& instance : session.instances) {
    instances.push_back({{"id", id_text(instance.id)},
                         {"name", instance.name},
                         {"mesh", meshes.index_of(*instance.geometry)},
                         {"occludes", instance.occludes}});
    const auto [first, end] = life_of(instance, session);
    if (first > 0 || end < session.frames.size()) instances.back()["life"] = {first, end};
    if (instance.moves) instances.back()["moves"] = true;
    for (int column = 0; column < 4; ++column)
      for (int row = 0; row < 3; ++row)
        transforms.push_back(static_cast<float>(instance.world_from_instance[column][row]));
  }
  page["instances"] = std::move(instances);
  data.add("instance_transforms", transforms);
  meshes.write(page, data);
}

// ---- the frames, a column a number ----

// Words that occur again and again are stored once.
class Words {
 public:
  uint32_t index_of(const std::string& word) {
    const auto [entry, is_new] = index_.emplace(word, static_cast<uint32_t>(list_.size()));
    if (is_new) list_.push_back(word);
    return entry->second;
  }
  const std::vector<std::string>& list() const { return list_; }

 private:
  std::unordered_map<std::string, uint32_t> index_;
  std::vector<std::string> list_;
};

template <typename T, typename V>
void append(std::vector<T>& row, const V& vector) {
  for (int axis = 0; axis < 3; ++axis) row.push_back(static_cast<T>(vector[axis]));
}
template <typename T>
void append(std::vector<T>& row, const Pose& pose) {
  append(row, pose.position_m);
  for (const double value : {pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w})
    row.push_back(static_cast<T>(value));
}

// Stored mover after mover, because the position of one mover changes little from frame to frame.
void write_movers(const SessionPage& session, Json& page, PageData& data) {
  std::vector<float> poses;
  Json movers = Json::array();
  for (const PageMover& mover : session.movers) {
    movers.push_back({{"instance", mover.instance}, {"first_pose", poses.size() / 7}});
    for (const Pose& pose : mover.poses) append(poses, pose);
  }
  page["movers"] = std::move(movers);
  data.add("mover_poses", poses);
}

// Numbers that are not known in a frame are not finite.
class Shots {
 public:
  void add(const PageFrame& frame, Words& words, Words& occluders) {
    PageShot unknown;
    unknown.place_m = glm::dvec3(kPageUnknown), unknown.asked.fill(kPageUnknown), unknown.now.fill(kPageUnknown),
    unknown.deviation.fill(kPageUnknown);
    unknown.sight_loss = unknown.worth = kPageUnknown;
    const PageShot& shot = frame.shot ? *frame.shot : unknown;
    append(place_m_, shot.place_m);
    for (const double value : shot.asked) asked_.push_back(value);
    for (const double value : shot.now) now_.push_back(value);
    for (const double value : shot.deviation) deviation_.push_back(value);
    sight_loss_.push_back(shot.sight_loss), worth_.push_back(shot.worth);
    const auto index = [&](uint64_t id) {
      return id != 0 ? static_cast<int32_t>(occluders.index_of(id_text(id))) : -1;
    };
    hidden_by_.push_back(index(shot.hidden_by)), hidden_target_.push_back(index(shot.hidden_target)),
        hidden_in_s_.push_back(shot.hidden_in_s);
    course_.push_back(words.index_of(shot.course));
    for (const double value : shot.losses) losses_.push_back(value);
  }
  void write(PageData& data) const {
    data.add("shot_place_m", place_m_), data.add("shot_asked", asked_), data.add("shot_now", now_),
        data.add("shot_deviation", deviation_);
    data.add("sight_loss", sight_loss_), data.add("worth", worth_);
    data.add("shot_hidden_by", hidden_by_), data.add("shot_hidden_target", hidden_target_),
        data.add("shot_hidden_in_s", hidden_in_s_);
    data.add("course", course_), data.add("course_losses", losses_);
  }

 private:
  std::vector<double> place_m_, asked_, now_, deviation_, sight_loss_, worth_, hidden_in_s_, losses_;
  std::vector<int32_t> hidden_by_, hidden_target_;
  std::vector<uint32_t> course_;
};

class Frames {
 public:
  void add(const PageFrame& frame) {
    shots_.add(frame, words_, occluders_);
    time_s_.push_back(frame.time_s);
    sequence_.push_back(static_cast<double>(frame.sequence));
    append(camera_, frame.camera);
    fov_rad_.push_back(frame.vertical_fov_rad);
    append(velocity_mps_, frame.velocity_mps);
    counts_.insert(counts_.end(), {frame.counts.all_visible, frame.counts.some_visible, frame.counts.none_visible});
    status_.push_back(words_.index_of(frame.status));
    reason_.push_back(words_.index_of(frame.reason));
    text_.push_back(words_.index_of(frame.text));
    cut_.push_back(frame.cut);
    flags_.push_back(frame.flags);
    merged_.push_back(frame.merged_ticks);
    stage_us_.insert(stage_us_.end(), frame.stage_us.begin(), frame.stage_us.end());
    queue_us_.push_back(static_cast<float>(frame.queue_us));
    latency_ms_.push_back(static_cast<float>(frame.latency_ms));
    clearance_m_.push_back(static_cast<float>(frame.clearance_m));
    uint32_t present = 0, steered = 0;
    for (size_t k = 0; k < frame.sights.size(); ++k) {
      add(frame.sights[k]);
      if (!frame.sights[k].present) continue;
      present |= 1u << k;
      if (frame.sights[k].steered) steered |= 1u << k;
    }
    present_.push_back(present), steered_.push_back(steered);
  }

  void write(Json& page, PageData& data) const {
    page["words"] = words_.list();
    page["occluders"] = occluders_.list();
    data.add("time_s", time_s_), data.add("sequence", sequence_);
    data.add("camera", camera_), data.add("fov_rad", fov_rad_), data.add("velocity_mps", velocity_mps_);
    data.add("counts", counts_), data.add("present", present_), data.add("steered", steered_);
    data.add("status", status_), data.add("reason", reason_), data.add("text", text_);
    data.add("cut", cut_), data.add("flags", flags_), data.add("merged", merged_);
    data.add("stage_us", stage_us_), data.add("queue_us", queue_us_);
    data.add("latency_ms", latency_ms_), data.add("clearance_m", clearance_m_);
    data.add("aim_m", aim_m_), data.add("visible_share", visible_), data.add("filtered_share", filtered_);
    data.add("true_share", true_), data.add("state", state_), data.add("distance_m", distance_m_);
    data.add("occluder", occluder_), data.add("occluder_share", occluder_share_);
    shots_.write(data);
  }

 private:
  void add(const PageSight& sight) {
    append(aim_m_, sight.aim_m);
    visible_.push_back(sight.visible_share);
    filtered_.push_back(sight.filtered_share);
    true_.push_back(sight.true_share);
    state_.push_back(words_.index_of(sight.state));
    distance_m_.push_back(sight.distance_m);
    const bool hidden = sight.occluder_id != 0;
    occluder_.push_back(hidden ? static_cast<int32_t>(occluders_.index_of(id_text(sight.occluder_id))) : -1);
    occluder_share_.push_back(sight.occluder_share);
  }

  Words words_, occluders_;
  Shots shots_;
  std::vector<double> time_s_, sequence_, camera_, fov_rad_;
  std::vector<float> velocity_mps_, stage_us_, queue_us_, latency_ms_, clearance_m_, aim_m_;
  std::vector<double> visible_, filtered_, true_, distance_m_, occluder_share_;
  std::vector<uint32_t> counts_, status_, reason_, text_, flags_, merged_, state_, present_, steered_;
  std::vector<int32_t> occluder_;
  std::vector<uint8_t> cut_;
};

// ---- cells ----

size_t cells_of_every(const SessionPage& session, size_t n) {
  size_t count = 0;
  for (size_t i = 0; i < session.frames.size(); i += n) count += session.frames[i].cells.size();
  return count;
}

class Cells {
 public:
  void add(uint32_t index, const PageFrame& frame) {
    frame_.push_back(index);
    first_.push_back(static_cast<uint32_t>(mask_.size()));
    chosen_.push_back(frame.chosen_cell);
    Aabb bounds;
    for (const PageCell& cell : frame.cells) bounds.grow(cell.position_m);
    append(low_, bounds.min), append(high_, bounds.max);
    const glm::vec3 scale = 65535.0f / glm::max(bounds.max - bounds.min, glm::vec3(1e-6f));
    for (const PageCell& cell : frame.cells) {
      append(position_, (cell.position_m - bounds.min) * scale + 0.5f);
      mask_.push_back(cell.visible_targets);
    }
  }
  void write(PageData& data) const {
    data.add("cell_frame", frame_), data.add("cell_first", first_), data.add("cell_chosen", chosen_);
    data.add("cell_low", low_), data.add("cell_high", high_);
    data.add("cell_position", position_), data.add("cell_mask", mask_);
  }

 private:
  std::vector<uint32_t> frame_, first_, mask_;
  std::vector<int32_t> chosen_;
  std::vector<float> low_, high_;
  std::vector<uint16_t> position_;
};

void write_cells(const SessionPage& session, PageData& data) {
  size_t n = 1;
  while (n < session.frames.size() && cells_of_every(session, n) > kMaxPageCells) ++n;
  Cells cells;
  for (size_t i = 0; i < session.frames.size(); i += n)
    if (!session.frames[i].cells.empty()) cells.add(static_cast<uint32_t>(i), session.frames[i]);
  cells.write(data);
}

// ---- everything else ----

void write_words(const SessionPage& session, Json& page) {
  page["title"] = session.title;
  page["notices"] = session.notices;
  page["facts"] = session.facts;
  page["aspect"] = session.aspect;
  page["body_radius_m"] = session.body_radius_m;
  page["clearance_reach_m"] = session.clearance_reach_m;
  page["stages"] = session.stages;
  page["flag_names"] = session.flags;
  page["columns"] = session.columns;
  Json figures = Json::array();
  for (const FigureRow& figure : session.figures)
    figures.push_back({{"name", figure.label}, {"values", figure.values}});
  page["figures"] = std::move(figures);
  Json targets = Json::array();
  for (const PageTarget& target : session.targets)
    targets.push_back({{"id", id_text(target.id)},
                       {"name", target.name},
                       {"weight", target.weight},
                       {"required", target.required},
                       {"radius_m", target.radius_m}});
  page["targets"] = std::move(targets);
  Json marks = Json::array();
  for (const PageMark& mark : session.marks)
    marks.push_back({{"frame", mark.frame}, {"kind", mark.kind}, {"text", mark.text}});
  page["marks"] = std::move(marks);
}

Status write_settings(const SessionPage& session, Json& page) {
  Json list = Json::array();
  for (size_t i = 0; i < session.settings.size(); ++i) {
    const auto& [title, json] = session.settings[i];
    Json value = json.empty() ? Json() : Json::parse(json, nullptr, false);
    if (value.is_discarded()) return invalid(at("settings", i, ".json"), "is no JSON");
    list.push_back({{"title", title}, {"value", std::move(value)}});
  }
  page["settings"] = std::move(list);
  return {};
}

void write_pictures(const SessionPage& session, Json& page) {
  Json pictures = Json::array();
  for (const PagePicture& picture : session.pictures) {
    std::string url = "data:";
    url.append(picture.media_type).append(";base64,").append(to_base64(picture.bytes));
    pictures.push_back({{"frame", picture.frame}, {"url", std::move(url)}});
  }
  page["pictures"] = std::move(pictures);
}

Json directory_of(const PageData& data) {
  Json directory = Json::object();
  for (const auto& [name, entry] : data.directory()) directory[name] = {entry.type, entry.offset, entry.count};
  return directory;
}

// JSON that may stand inside a <script>: no "<" can end it. Invalid UTF-8 is replaced.
std::string inside_script(const Json& json) {
  std::string text;
  for (const char c : json.dump(-1, ' ', false, Json::error_handler_t::replace)) {
    if (c == '<')
      text.append("\\u003c");
    else
      text.push_back(c);
  }
  return text;
}

std::string html_text(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '<')
      escaped.append("&lt;");
    else if (c == '&')
      escaped.append("&amp;");
    else
      escaped.push_back(c);
  }
  return escaped;
}

// The template with each {{NAME}} replaced, in their order in it.
std::string fill(std::string_view page, std::initializer_list<std::pair<std::string_view, std::string>> places) {
  std::string filled;
  for (const auto& [name, text] : places) {
    const size_t place = page.find(name);
    filled.append(page.substr(0, place)).append(text);
    page.remove_prefix(place + name.size());
  }
  return filled.append(page);
}

}  // namespace

Result<std::string> session_page(const SessionPage& session) {
  if (Status ok = check(session); !ok) return tl::unexpected(ok.error());
  Json page;
  PageData data;
  write_words(session, page);
  if (Status ok = write_settings(session, page); !ok) return tl::unexpected(ok.error());
  write_scene(session, page, data);
  write_movers(session, page, data);
  Frames frames;
  for (const PageFrame& frame : session.frames) frames.add(frame);
  frames.write(page, data);
  write_cells(session, data);
  write_pictures(session, page);
  page["arrays"] = directory_of(data);
  return fill(
      page_template(),
      {{"{{TITLE}}", html_text(session.title)}, {"{{SESSION}}", inside_script(page)}, {"{{DATA}}", data.encoded()}});
}

Status write_session_page(const SessionPage& session, const std::string& path) {
  const Result<std::string> page = session_page(session);
  if (!page) return tl::unexpected(page.error());
  std::ofstream file(path, std::ios::binary);
  file << *page;
  if (!file.flush()) return fail(ErrorCode::kUnavailable, path, "cannot be written");
  return {};
}

}  // namespace sightline
