#include "server/sample/extent.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <optional>

#include "server/base/transform.h"

namespace sightline {
namespace {

// The most rays of one view. Shapes that cover at least 1 % of the frame get all their points.
constexpr size_t kMaxRays = 128 * kExtentPoints;

constexpr std::chrono::milliseconds kLookWhileWaiting{50};

// A ray into very many triangles takes about so many microseconds.
constexpr uint64_t kUnitsOfRay = 64;

// Steps of the R2 sequence: 1 / g and 1 / g^2, where g^3 = g + 1.
constexpr glm::dvec2 kStep(0.7548776662466927, 0.5698402909980532);

// The greatest squared distance from the centre, in radii, of points in the bounding sphere; above 1 for rounding.
constexpr double kInSphere = 1.0 + 1e-6;

glm::dvec2 wrapped(const glm::dvec2& p) {
  return p - glm::floor(p);
}

struct Frame {
  glm::dvec2 low{std::numeric_limits<double>::infinity()};
  glm::dvec2 high{-std::numeric_limits<double>::infinity()};
};

// An image of the geometry. Its coordinates lie on a plane across the view direction, at unit distance from the viewer;
// for a parallel projection they are in bounding radii.
class Picture {
 public:
  Picture(const Geometry& geometry, const ExtentView& view)
      : center_(geometry.center),
        radius_(geometry.radius_m),
        parallel_(std::isinf(view.distance)),
        distance_(parallel_ ? 2.0 : view.distance),
        rotation_(upright(geometry.bounds, view.direction)) {
    fit(geometry.positions);
  }

  // A point of the frame, both coordinates in [0, 1].
  glm::dvec2 at(const glm::dvec2& unit) const { return frame_.low + unit * (frame_.high - frame_.low); }

  // In m^2, on a plane across the direction through the centre.
  double frame_area_m2() const {
    const glm::dvec2 size = frame_.high - frame_.low;
    return size.x * size.y * (parallel_ ? 1.0 : distance_ * distance_) * radius_ * radius_;
  }

  SurfaceHit cast(const RayCaster& caster, const glm::dvec2& image) const {
    const glm::dvec3 eye(0.0, 0.0, distance_), across(image, 0.0);
    const glm::dvec3 origin = parallel_ ? eye + across : eye, forward(0.0, 0.0, -1.0);
    const glm::dvec3 direction = parallel_ ? forward : across + forward;
    return caster.first_hit(center_ + rotation_ * (origin * radius_), rotation_ * direction);
  }

 private:
  // The longest side of the shape is upright in the image, so that the frame of a long shape is narrow.
  static glm::dmat3 upright(const Aabb& bounds, const glm::dvec3& direction) {
    const glm::vec3 size = bounds.half_extent();
    const int longest = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    glm::dvec3 up(0.0), right(0.0);
    up[longest] = right[(longest + 1) % 3] = 1.0;
    return glm::mat3_cast(look_rotation(-direction, up, right));
  }

  // The frame around all vertices of triangles. Those outside the bounding sphere belong to none.
  void fit(const std::vector<glm::vec3>& positions) {
    for (const glm::vec3& p : positions) {
      const glm::dvec3 seen = (glm::dvec3(p) - center_) * rotation_ / radius_;  // by the transpose of the rotation
      if (glm::dot(seen, seen) > kInSphere) continue;
      const glm::dvec2 image = glm::dvec2(seen) / (parallel_ ? 1.0 : distance_ - seen.z);
      frame_.low = glm::min(frame_.low, image), frame_.high = glm::max(frame_.high, image);
    }
  }

  const glm::dvec3 center_;
  const double radius_;
  const bool parallel_;
  const double distance_;      // of the viewer from the centre, in radii
  const glm::dmat3 rotation_;  // mesh_from_image
  Frame frame_;
};

// Tries random points of the frame until one hits.
std::optional<glm::dvec2> first_point(const RayCaster& caster, const Picture& picture, CounterRandom& random,
                                      WorkLimit::Part& work) {
  for (size_t ray = 0; ray < kMaxRays && !work.ends(kUnitsOfRay); ++ray) {
    const double x = random.next_in(0.0, 1.0), y = random.next_in(0.0, 1.0);
    if (picture.cast(caster, picture.at({x, y})).hit()) return glm::dvec2(x, y);
  }
  return std::nullopt;
}

struct Followed {
  size_t found = 0, rays = 0;
};

// Finds hits along the sequence from `start`; fewer than requested when the rays run out.
Followed follow(const RayCaster& caster, const Picture& picture, const glm::dvec2& start, std::span<glm::vec3> points,
                WorkLimit::Part& work) {
  Followed out;
  for (; out.rays < kMaxRays && !work.ends(kUnitsOfRay) && out.found < points.size(); ++out.rays) {
    const SurfaceHit hit = picture.cast(caster, picture.at(wrapped(start + kStep * static_cast<double>(out.rays))));
    if (hit.hit()) points[out.found++] = glm::vec3(hit.point_m);
  }
  return out;
}

// Fibonacci lattice (Swinbank & Purser, "Fibonacci grids: a novel approach to global modelling", 2006).
glm::dvec3 lattice_direction(size_t index) {
  const double y = 1.0 - (2.0 * static_cast<double>(index) + 1.0) / kExtentDirections;
  const double angle = 2.0 * std::numbers::pi * static_cast<double>(index) / std::numbers::phi;
  const double around = std::sqrt(1.0 - y * y);
  return {around * std::cos(angle), y, around * std::sin(angle)};
}

// `inverse` is 1 / distance in radii.
size_t nearest_distance(double inverse) {
  size_t best = 0;
  for (size_t i = 1; i < kExtentDistances.size(); ++i)
    if (std::abs(1.0 / kExtentDistances[i] - inverse) < std::abs(1.0 / kExtentDistances[best] - inverse)) best = i;
  return best;
}

}  // namespace

double sample_extent(const RayCaster& caster, const ExtentView& view, CounterRandom& random,
                     std::span<glm::vec3> points, WorkLimit::Part& work) {
  const Geometry& geometry = caster.geometry();
  Followed followed;
  double frame_m2 = 0;
  if (geometry.triangle_count() > 0 && geometry.radius_m > 0) {
    const Picture picture(geometry, view);
    frame_m2 = picture.frame_area_m2();
    if (const auto start = first_point(caster, picture, random, work))
      followed = follow(caster, picture, *start, points, work);
  }
  const size_t found = followed.found;
  if (found == 0) std::ranges::fill(points, geometry.center);
  for (size_t i = found; found > 0 && i < points.size(); ++i) points[i] = points[i - found];
  return found > 0 ? frame_m2 * static_cast<double>(found) / static_cast<double>(followed.rays) : 0.0;
}

ExtentTable::ExtentTable(const Geometry& geometry)
    : center_m_(geometry.center),
      radius_m_(geometry.radius_m),
      points_m_(kExtentViews * kExtentPoints),
      areas_m2_(kExtentViews) {
  for (size_t i = 0; i < kExtentDirections; ++i) directions_[i] = lattice_direction(i);
}

std::shared_ptr<const ExtentTable> ExtentTable::build(const Geometry& geometry, uint64_t seed, WorkLimit* limit) {
  WorkLimit::Part work(limit);
  std::shared_ptr<ExtentTable> table(new ExtentTable(geometry));
  const RayCaster caster(geometry);
  for (size_t index = 0; index < kExtentViews; ++index) {
    CounterRandom random(seed ^ geometry.hash.low, index, RandomPurpose::kExtentPoints);
    table->areas_m2_[index] = sample_extent(
        caster, view(index), random, std::span(table->points_m_).subspan(index * kExtentPoints, kExtentPoints), work);
    if (work.ends()) return nullptr;
  }
  return table;
}

ExtentView ExtentTable::view(size_t index) {
  return {lattice_direction(index % kExtentDirections), kExtentDistances[index / kExtentDirections]};
}

size_t ExtentTable::view_index(const glm::dvec3& viewer_mesh_m) const {
  const glm::dvec3 along = viewer_mesh_m - center_m_;
  const double distance = glm::length(along);
  const double inverse = distance > radius_m_ ? radius_m_ / distance : 1.0;
  size_t nearest = 0;
  double most = -std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < kExtentDirections; ++i)
    if (const double closeness = glm::dot(directions_[i], along); closeness > most) most = closeness, nearest = i;
  return nearest_distance(inverse) * kExtentDirections + nearest;
}

std::span<const glm::vec3> ExtentTable::points_of_view(size_t index) const {
  return std::span(points_m_).subspan(index * kExtentPoints, kExtentPoints);
}

std::span<const glm::vec3> ExtentTable::points(const glm::dvec3& viewer_mesh_m) const {
  return points_of_view(view_index(viewer_mesh_m));
}

std::span<const glm::vec3> ExtentTable::points_blended(const glm::dvec3& viewer_mesh_m, const glm::dvec2& unit) const {
  // The cone that has one direction's share of the sphere: 4 pi / kExtentDirections = 2 pi (1 - cosine).
  constexpr double kCosine = 1.0 - 2.0 / kExtentDirections;
  const double tangent = std::sqrt(1.0 - kCosine * kCosine) / kCosine;
  const glm::dvec3 along = viewer_mesh_m - center_m_;
  const double away = glm::length(along) * tangent * std::sqrt(unit.x);  // uniform in a disc
  const double angle = 2.0 * std::numbers::pi * unit.y;
  if (away <= 0.0) return points(viewer_mesh_m);
  const glm::dmat3 frame = glm::mat3_cast(look_rotation(along, {0, 1, 0}, {1, 0, 0}));
  return points(viewer_mesh_m + away * (frame[0] * std::cos(angle) + frame[1] * std::sin(angle)));
}

void pick_points(std::span<const glm::vec3> points, uint64_t tick, size_t count, std::vector<glm::vec3>& out) {
  out.clear();
  if (points.empty()) return;
  const size_t size = points.size(), picked = std::min(count, size);
  const size_t first = tick % size * picked % size;
  for (size_t i = 0; i < picked; ++i) out.push_back(points[(first + i) % size]);
}

std::shared_ptr<const ExtentTable> ExtentCache::get(const std::shared_ptr<const Geometry>& geometry, WorkLimit* work) {
  for (WorkLimit::Part part(work);;) {
    std::promise<std::shared_ptr<const ExtentTable>> built;
    FutureTable table;
    bool is_new = false;
    {
      const MutexLock lock(mutex_);
      is_new = !by_key_.contains(geometry->key);
      if (is_new) std::erase_if(by_key_, [](const auto& entry) { return entry.second.geometry.expired(); });
      Entry& entry = by_key_[geometry->key];
      if (is_new) entry.table = built.get_future().share();
      entry.geometry = geometry;
      table = entry.table;
    }
    if (is_new) return build(geometry, built, work);
    while (table.wait_for(kLookWhileWaiting) != std::future_status::ready)
      if (part.ends_now()) return nullptr;
    if (auto found = table.get()) return found;
  }
}

// Those that wait must be told in any case.
std::shared_ptr<const ExtentTable> ExtentCache::build(const std::shared_ptr<const Geometry>& geometry,
                                                      std::promise<std::shared_ptr<const ExtentTable>>& built,
                                                      WorkLimit* work) {
  std::shared_ptr<const ExtentTable> table;
  const auto tell = [&] {
    if (!table) {
      const MutexLock lock(mutex_);
      by_key_.erase(geometry->key);
    }
    built.set_value(table);
  };
  try {
    table = ExtentTable::build(*geometry, seed_, work);
  } catch (...) {
    tell();
    throw;
  }
  tell();
  return table;
}

bool ExtentCache::has(const Geometry& geometry) const {
  const MutexLock lock(mutex_);
  const auto found = by_key_.find(geometry.key);
  return found != by_key_.end() && found->second.table.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

size_t ExtentCache::count() const {
  const MutexLock lock(mutex_);
  return by_key_.size();
}

}  // namespace sightline
