#include "scenes/motion_tracks.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>

namespace sightline::scenes {
namespace {

constexpr double kCornerRate_hz = 16.0, kAttackRate_hz = 20.0;
constexpr double kPitchLength_m = 105.0, kPitchWidth_m = 68.0;
constexpr double kPlayer_m = 1.8;
constexpr double kCorridorMiddle_m = -1.5;  // in the coordinates of the file

std::vector<std::string_view> parts_of(std::string_view line, char separator) {
  std::vector<std::string_view> parts;
  for (size_t at = 0;;) {
    const size_t end = line.find(separator, at);
    parts.push_back(line.substr(at, end - at));
    if (end == std::string_view::npos) return parts;
    at = end + 1;
  }
}

bool read_number(std::string_view text, double& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && std::isfinite(value);
}

// The columns id, frame, x, y and z of a table of text, which may begin with lines that are none.
struct Table {
  const char* file;
  char separator;
  size_t id, frame;  // the columns; x, y and z follow the second
  bool has_header;
  double rate_hz;
  glm::dvec3 (*place)(double x, double y, double z);
};

Status add_sample(std::string_view line, const Table& table, std::map<int, Track>& tracks) {
  const std::vector<std::string_view> parts = parts_of(line, table.separator);
  double id = 0, frame = 0, x = 0, y = 0, z = 0;
  if (parts.size() < 5 || !read_number(parts[table.id], id) || !read_number(parts[table.frame], frame) ||
      !read_number(parts[2], x) || !read_number(parts[3], y) || !read_number(parts[4], z))
    return invalid("motion", std::string(table.file).append(": no sample: ").append(line.substr(0, 80)));
  Track& track = tracks[static_cast<int>(id)];
  if (track.positions_m.empty()) {
    track.id = static_cast<int>(id), track.rate_hz = table.rate_hz;
    track.first_s = frame / table.rate_hz;
  }
  track.positions_m.push_back(table.place(x, y, z));
  if (std::abs(track.last_s() - frame / table.rate_hz) > 0.5 / table.rate_hz)
    return invalid("motion",
                   std::string(table.file).append(": a frame is missing before: ").append(line.substr(0, 80)));
  return {};
}

Result<std::vector<Track>> read_table(const std::string& folder, const Table& table) {
  if (folder.empty())
    return fail(ErrorCode::kNotFound, "motion",
                std::string("no folder of motion was given, neither by --motion nor by ").append(kMotionVariable));
  std::ifstream file(folder + "/" + table.file);
  if (!file) return fail(ErrorCode::kNotFound, "motion", folder + "/" + table.file + " is missing");
  std::map<int, Track> tracks;
  std::string line;
  if (table.has_header) std::getline(file, line);
  while (std::getline(file, line)) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line[0] == '#') continue;
    if (Status added = add_sample(line, table, tracks); !added) return tl::unexpected(added.error());
  }
  std::vector<Track> in_order;
  for (auto& [id, track] : tracks)
    if (track.positions_m.size() > 1) in_order.push_back(std::move(track));
  return in_order;
}

// Straight on along x or z, whichever the body moved along more.
glm::dvec3 straight_on(const glm::dvec3& way_mps) {
  return std::abs(way_mps.x) > std::abs(way_mps.z) ? glm::dvec3(way_mps.x, 0, 0) : glm::dvec3(0, 0, way_mps.z);
}

}  // namespace

std::string motion_folder(const std::string& folder) {
  if (!folder.empty()) return folder;
  const char* value = std::getenv(kMotionVariable);
  return value ? value : "";
}

glm::dvec3 Track::position_m(double time_s) const {
  const size_t last = positions_m.size() - 1;
  const auto second = std::min(last, static_cast<size_t>(rate_hz));
  const double seconds = static_cast<double>(second) / rate_hz;
  if (time_s < first_s)
    return positions_m[0] + straight_on((positions_m[second] - positions_m[0]) / seconds) * (time_s - first_s);
  if (time_s >= last_s())
    return positions_m[last] +
           straight_on((positions_m[last] - positions_m[last - second]) / seconds) * (time_s - last_s());
  const double at = (time_s - first_s) * rate_hz;
  const size_t i = std::min(static_cast<size_t>(at), last - 1);
  const double u = at - static_cast<double>(i);
  const glm::dvec3 &p = positions_m[i], &q = positions_m[i + 1];
  const glm::dvec3 before = i > 0 ? positions_m[i - 1] : p * 2.0 - q,
                   after = i + 2 <= last ? positions_m[i + 2] : q * 2.0 - p;
  const glm::dvec3 m = (q - before) * 0.5, n = (after - p) * 0.5;
  const double u2 = u * u, u3 = u2 * u;
  return p * (2 * u3 - 3 * u2 + 1) + m * (u3 - 2 * u2 + u) + q * (3 * u2 - 2 * u3) + n * (u3 - u2);
}

Result<std::vector<Track>> read_corner(const std::string& folder) {
  return read_table(folder, {.file = "corner_traj.txt",
                             .separator = '\t',
                             .id = 0,
                             .frame = 1,
                             .has_header = false,
                             .rate_hz = kCornerRate_hz,
                             .place = [](double x, double y, double z) {
                               return glm::dvec3(kCorridorMiddle_m - x, z, y - kCorridorMiddle_m);
                             }});
}

Result<std::vector<Track>> read_attack(const std::string& folder) {
  return read_table(folder, {.file = "football_goal.csv",
                             .separator = ',',
                             .id = 0,
                             .frame = 1,
                             .has_header = true,
                             .rate_hz = kAttackRate_hz,
                             .place = [](double x, double y, double z) {
                               return glm::dvec3((x / 100 - 0.5) * kPitchLength_m, z, (y / 100 - 0.5) * kPitchWidth_m);
                             }});
}

}  // namespace sightline::scenes
