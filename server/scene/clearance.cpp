#include "server/scene/clearance.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "server/base/vector_clones.h"

namespace sightline {
namespace {

// A sphere that overlaps by less than this counts as touching, so that a sphere that a sweep brought into contact can
// slide away.
constexpr double kTouchM = 1e-9;
// A sweep ends when a step is shorter than this; the error is then far below 1 mm.
constexpr double kLeastAdvanceM = 1e-7;
// The distance that a camera can move before static colliders are gathered again.
constexpr double kGatheredFartherM = 4.0;
// There is memory for so many moving colliders from the start. A camera that meets more of them than before does not
// allocate in the middle of a game.
constexpr size_t kExpectedMovers = 256;

glm::dvec3 closest_on_segment(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b) {
  const glm::dvec3 ab = b - a;
  const double squared = glm::dot(ab, ab);
  return squared > 0 ? a + ab * std::clamp(glm::dot(p - a, ab) / squared, 0.0, 1.0) : a;
}

glm::dvec3 closest_on_edges(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  glm::dvec3 best = closest_on_segment(p, a, b);
  for (const glm::dvec3& q : {closest_on_segment(p, b, c), closest_on_segment(p, c, a)})
    if (glm::distance(p, q) < glm::distance(p, best)) best = q;
  return best;
}

double distance_to_box(const glm::dvec3& p, const Aabb& box) {
  const glm::dvec3 outside = glm::max(glm::max(glm::dvec3(box.min) - p, p - glm::dvec3(box.max)), glm::dvec3(0.0));
  return glm::length(outside);
}

// A straight move in one collider's frame: from + s * move, s in [0, 1].
class Path {
 public:
  // `margin`: at least the sphere's radius, in this frame.
  Path(const glm::dvec3& from, const glm::dvec3& move, double margin)
      : from_(from), per_move_(1.0 / move), margin_(margin) {}

  // The first s at which the point is inside `box` grown by the margin; infinity when it never is.
  double enters(const Aabb& box) const {
    double first = 0.0, last = 1.0;
    for (int axis = 0; axis < 3; ++axis) {
      const double low = box.min[axis] - margin_ - from_[axis], high = box.max[axis] + margin_ - from_[axis];
      if (std::isinf(per_move_[axis])) {
        if (low > 0 || high < 0) return INFINITY;
        continue;
      }
      const double a = low * per_move_[axis], b = high * per_move_[axis];
      first = std::max(first, std::min(a, b));
      last = std::min(last, std::max(a, b));
    }
    return first <= last ? first : INFINITY;
  }

 private:
  glm::dvec3 from_, per_move_;
  double margin_;
};

// Added where boxes are compared, so that rounding never prunes a contact.
constexpr double kPruneSlackM = 1e-6;

using Corners = std::array<glm::vec3, 3>;

Corners corners(const Geometry& geometry, uint32_t first_index) {
  const uint32_t* i = geometry.indices.data() + first_index;
  return {geometry.positions[i[0]], geometry.positions[i[1]], geometry.positions[i[2]]};
}

Aabb bounds_of(const Corners& t) {
  return {glm::min(t[0], glm::min(t[1], t[2])), glm::max(t[0], glm::max(t[1], t[2]))};
}

using WorldTriangle = std::array<glm::dvec3, 3>;

// The distance, at most `length_m`, that a point moves from `from` along unit `direction` before it is within
// `radius_m` of the triangle. The distance of a moving point from a convex set is convex in time. So Newton's method
// from the left never passes the first contact, and a distance that grows never shrinks again. This is conservative
// advancement with the directional bound (van den Bergen, "Ray casting against general convex objects", 2004). Adds the
// number of its steps to `steps`.
double advance(const glm::dvec3& from, const glm::dvec3& direction, double length_m, double radius_m,
               const WorldTriangle& triangle, uint64_t& steps) {
  double moved = 0.0;
  for (int step = 0; step < 100 && moved < length_m; ++step) {
    ++steps;
    const glm::dvec3 p = from + direction * moved;
    const glm::dvec3 away = p - closest_on_triangle(p, triangle[0], triangle[1], triangle[2]);
    const double distance = glm::length(away);
    if (step == 0 && distance < radius_m) return 0.0;
    if (distance == 0) return moved;  // only with radius 0
    const double approach = -glm::dot(direction, away) / distance;
    if (approach <= 0) return length_m;
    const double free = (distance - radius_m) / approach;
    if (free < kLeastAdvanceM) return moved;
    moved += free;
  }
  return std::min(moved, length_m);
}

// The same for a sphere, which may graze: an overlap of less than kTouchM does not stop it.
double sweep_triangle(const glm::dvec3& from, const glm::dvec3& direction, double length_m, double radius_m,
                      const WorldTriangle& triangle, uint64_t& steps) {
  const double pressed = std::max(radius_m - kTouchM, 0.0);
  if (advance(from, direction, length_m, pressed, triangle, steps) >= length_m) return length_m;
  return advance(from, direction, length_m, radius_m, triangle, steps);
}

// The rays of is_inside point to a cube's faces and corners, opposite ones in turn. The cube is turned, so that no ray
// runs along a world axis or a diagonal, on which edges of boxes lie.
constexpr double kRayM = 2e4;
constexpr int kMostOutside = 2;
const std::array<glm::dvec3, 14> kRays = [] {
  const glm::dquat turn = glm::normalize(glm::dquat(0.9, 0.31, -0.17, 0.23));
  std::array<glm::dvec3, 14> rays;
  size_t n = 0;
  for (const glm::dvec3& ray : {glm::dvec3(0, 1, 0), glm::dvec3(1, 0, 0), glm::dvec3(0, 0, 1), glm::dvec3(1, 1, 1),
                                glm::dvec3(1, 1, -1), glm::dvec3(1, -1, 1), glm::dvec3(1, -1, -1)})
    for (const double sign : {1.0, -1.0}) rays[n++] = turn * glm::normalize(sign * ray);
  return rays;
}();

// Where a ray passes through a triangle (Moeller & Trumbore, 1997), as a share of `move`; `leaves` if it meets the
// back.
struct Crossing {
  bool hit = false, leaves = false;
  double share = 0.0;
};
Crossing cross(const glm::dvec3& from, const glm::dvec3& move, const Corners& t) {
  const glm::dvec3 a(t[0]), ab = glm::dvec3(t[1]) - a, ac = glm::dvec3(t[2]) - a;
  const glm::dvec3 p = glm::cross(move, ac);
  const double det = glm::dot(ab, p);
  if (det == 0) return {};
  const glm::dvec3 to_from = from - a, q = glm::cross(to_from, ab);
  const double u = glm::dot(to_from, p) / det, v = glm::dot(move, q) / det, share = glm::dot(ac, q) / det;
  if (u < 0 || v < 0 || u + v > 1 || share <= 0) return {};
  return {true, det < 0, share};
}

// Spheres, by coordinate.
struct Spheres {
  const double *x_m, *y_m, *z_m, *radius_m;
  size_t count;
};
// The number of spheres that are tested at once, and that take about as long as the test of one triangle.
constexpr size_t kSpheresAtOnce = 128, kSpheresOfTest = 32;

// Sets 1 for spheres that the moving sphere touches on its path along unit `direction`, to within rounding, else 0.
SIGHTLINE_VECTOR_CLONES
void mark_beside(const Spheres& spheres, const glm::dvec3& from_m, const glm::dvec3& direction, double length_m,
                 double radius_m, uint8_t* __restrict beside) {
  constexpr double kSlack = 1e-9;
  const double from_x = from_m.x, from_y = from_m.y, from_z = from_m.z, along_x = direction.x, along_y = direction.y,
               along_z = direction.z, length = length_m, radius = radius_m + kSlack;
  const double *__restrict x = spheres.x_m, *__restrict y = spheres.y_m, *__restrict z = spheres.z_m,
               *__restrict r = spheres.radius_m;
  for (size_t i = 0; i < spheres.count; ++i) {
    const double dx = x[i] - from_x, dy = y[i] - from_y, dz = z[i] - from_z;
    const double at = dx * along_x + dy * along_y + dz * along_z, late = at < 0.0 ? 0.0 : at,
                 t = late < length ? late : length;
    const double ex = dx - t * along_x, ey = dy - t * along_y, ez = dz - t * along_z;
    const double reach = r[i] + radius, apart = ex * ex + ey * ey + ez * ez;
    beside[i] = apart <= reach * reach * (1 + kSlack) ? 1 : 0;
  }
}

}  // namespace

glm::dvec3 closest_on_triangle(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const glm::dvec3 ab = b - a, ac = c - a, ap = p - a;
  const double d1 = glm::dot(ab, ap), d2 = glm::dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const glm::dvec3 bp = p - b;
  const double d3 = glm::dot(ab, bp), d4 = glm::dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const glm::dvec3 cp = p - c;
  const double d5 = glm::dot(ab, cp), d6 = glm::dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  // Outside an edge, or so thin that rounding decides: the edges are always right then.
  if (vc <= 0 || vb <= 0 || va <= 0) return closest_on_edges(p, a, b, c);
  const double scale = 1.0 / (va + vb + vc);
  return a + ab * (vb * scale) + ac * (vc * scale);
}

void ClearanceField::allow(uint64_t tests) const {
  allowed_ = left_ = tests;
}

void ClearanceField::add_if_near(const SceneMirror& mirror, uint32_t slot, const glm::dvec3& center_m, double reach_m,
                                 std::span<const uint32_t> ignored_slots, double ahead_s, std::vector<Collider>& into) {
  const Instance& instance = mirror.instances()[slot];
  if (!instance.geometry || !instance.collides()) return;
  const glm::dvec3 center = center_ahead_m(instance, ahead_s);
  const double reach = reach_m + instance.radius_m;
  if (glm::dot(center - center_m, center - center_m) > reach * reach) return;
  if (std::binary_search(ignored_slots.begin(), ignored_slots.end(), slot)) return;
  const Affine there = world_from_instance_ahead(instance, ahead_s), back = inverse(there);
  into.push_back({instance.geometry.get(), there, back, center, instance.radius_m, 1.0 / max_stretch(back), slot});
}

void ClearanceField::gather_standing(const SceneMirror& mirror, const glm::dvec3& center_m, double reach_m,
                                     std::span<const uint32_t> ignored_slots) {
  // Ignored slots of moving instances do not affect the static colliders.
  const bool all = std::all_of(ignored_slots.begin(), ignored_slots.end(),
                               [&](uint32_t slot) { return mirror.instances()[slot].moving; });
  const bool holds = all && gathered_.all && gathered_.identity == mirror.identity() &&
                     gathered_.static_version == mirror.static_version() &&
                     glm::distance(gathered_.center_m, center_m) + reach_m <= gathered_.reach_m;
  if (holds) return;
  stands_listed_ = false;
  const double farther_m = reach_m + kGatheredFartherM;
  gathered_ = {mirror.identity(), mirror.static_version(), center_m, farther_m, all};
  standing_.clear();
  for (uint32_t slot = 0; slot < mirror.instances().size(); ++slot)
    if (!mirror.instances()[slot].moving) add_if_near(mirror, slot, center_m, farther_m, ignored_slots, 0.0, standing_);
}

void ClearanceField::gather(const SceneMirror& mirror, const glm::dvec3& center_m, double reach_m,
                            std::span<const uint32_t> ignored_slots) {
  gather_standing(mirror, center_m, reach_m, ignored_slots);
  add_movers(mirror, center_m, reach_m, ignored_slots, 0.0);
  list_spheres(center_m, reach_m);
}

void ClearanceField::gather_movers(const SceneMirror& mirror, const glm::dvec3& center_m, double reach_m,
                                   std::span<const uint32_t> ignored_slots, double ahead_s) {
  standing_.clear();
  stands_listed_ = false;
  gathered_ = {};
  add_movers(mirror, center_m, reach_m, ignored_slots, ahead_s);
  list_spheres(center_m, reach_m);
}

void ClearanceField::add_movers(const SceneMirror& mirror, const glm::dvec3& center_m, double reach_m,
                                std::span<const uint32_t> ignored_slots, double ahead_s) {
  const std::span<const uint32_t> slots = mirror.moving_slots();
  moving_.clear();
  moving_.reserve(std::min(slots.size(), kExpectedMovers));
  for (const uint32_t slot : slots) add_if_near(mirror, slot, center_m, reach_m, ignored_slots, ahead_s, moving_);
}

void ClearanceField::list_spheres(const glm::dvec3& center_m, double reach_m) {
  center_m_ = center_m, reach_m_ = reach_m;
  const size_t count = standing_.size() + moving_.size();
  // Static colliders are mostly in the lists already.
  const size_t first = stands_listed_ ? standing_.size() : 0;
  for (std::vector<double>* each : {&x_m_, &y_m_, &z_m_, &radius_m_}) {
    each->reserve(standing_.size() + moving_.capacity());
    each->resize(count);
  }
  for (size_t index = first; index < count; ++index) {
    const Collider& collider = at(index);
    x_m_[index] = collider.center_m.x, y_m_[index] = collider.center_m.y, z_m_[index] = collider.center_m.z;
    radius_m_[index] = collider.radius_m;
  }
  stands_listed_ = true;
  tests_of_query_ = 1 + collider_count() / kSpheresOfTest;
  allow(kAnyNumber);
}

// Visits the triangles of a collider whose box, and whose nodes' boxes, have bound(box) < limit(); nearer nodes first.
// `limit` may fall while `visit(corners)` is called. Ends early when the allowance is used up.
template <typename Bound, typename Limit, typename Visit>
void ClearanceField::search(const Collider& collider, Bound bound, Limit limit, Visit visit) const {
  struct Entry {
    uint32_t node;
    double bound;
  };
  const Geometry& geometry = *collider.geometry;
  std::array<Entry, kMaxTreeDepth + 1> stack;
  for (const TriangleTree* const each : {&geometry.occluding, &geometry.see_through}) {
    const TriangleTree& tree = *each;
    if (tree.empty()) continue;
    size_t depth = 0;
    stack[depth++] = {0, bound(tree[0].bounds)};
    while (depth > 0) {
      const Entry entry = stack[--depth];
      if (!(entry.bound < limit())) continue;
      const TreeNode& node = tree[entry.node];
      if (!take(node.is_leaf() ? node.index_count / 3 : 1)) return;
      if (!node.is_leaf()) {
        Entry near{entry.node + 1, bound(tree[entry.node + 1].bounds)}, far{node.right, bound(tree[node.right].bounds)};
        if (far.bound < near.bound) std::swap(near, far);
        assert(depth + 2 <= stack.size());
        stack[depth++] = far;
        stack[depth++] = near;
        continue;
      }
      for (uint32_t i = node.first_index; i < node.first_index + node.index_count; i += 3) {
        const Corners triangle = corners(geometry, i);
        if (bound(bounds_of(triangle)) < limit()) visit(triangle);
      }
    }
  }
}

bool ClearanceField::leaves_solid(const glm::dvec3& from_m, const glm::dvec3& direction) const {
  const Way way(from_m, from_m + kRayM * direction, 0.0);
  int left = 0;
  double first = INFINITY;
  bool first_is_back = false;
  for_each_beside(way, [&](size_t index) {
    const Collider& collider = at(index);
    const glm::dvec3 from = transform_point(collider.instance_from_world, from_m),
                     move = transform_vector(collider.instance_from_world, way.to_m - way.from_m);
    const Path path(from, move, kPruneSlackM / collider.min_stretch);
    const auto visit = [&](const Corners& t) {
      const Crossing crossing = cross(from, move, t);
      if (!crossing.hit) return;
      left += crossing.leaves ? 1 : -1;
      if (crossing.share < first) first = crossing.share, first_is_back = crossing.leaves;
    };
    search(
        collider, [&](const Aabb& box) { return path.enters(box); }, [] { return INFINITY; }, visit);
    return true;
  });
  return !exhausted() && (left > 0 || first_is_back);
}

bool ClearanceField::is_inside(const glm::dvec3& point_m) const {
  int outside = 0;
  for (const glm::dvec3& direction : kRays)
    if (!leaves_solid(point_m, direction) && ++outside > kMostOutside) return false;
  return true;
}

size_t ClearanceField::collider_count() const {
  size_t count = 0;
  for (size_t i = 0; i < x_m_.size(); ++i) {
    const glm::dvec3 away = glm::dvec3(x_m_[i], y_m_[i], z_m_[i]) - center_m_;
    const double reach = reach_m_ + radius_m_[i];
    count += glm::dot(away, away) <= reach * reach;
  }
  return count;
}

double ClearanceField::clearance_m(const glm::dvec3& point_m, double reach_m) const {
  glm::dvec3 surface_m;
  return nearest(point_m, reach_m, surface_m) ? glm::distance(point_m, surface_m) : reach_m;
}

ClearanceField::Way::Way(const glm::dvec3& from, const glm::dvec3& to, double radius)
    : from_m(from),
      to_m(to),
      length_m(glm::distance(from, to)),
      direction(length_m > 0 ? (to - from) / length_m : glm::dvec3(0.0)),
      radius_m(radius) {}

template <typename Take>
bool ClearanceField::for_each_beside(const Way& way, Take take_one) const {
  if (!take(tests_of_query_)) return false;
  std::array<uint8_t, kSpheresAtOnce> beside;
  for (size_t first = 0; first < x_m_.size(); first += kSpheresAtOnce) {
    const size_t count = std::min(kSpheresAtOnce, x_m_.size() - first);
    mark_beside({&x_m_[first], &y_m_[first], &z_m_[first], &radius_m_[first], count}, way.from_m, way.direction,
                way.length_m, way.radius_m, beside.data());
    for (size_t i = 0; i < count; ++i)
      if (beside[i] != 0 && (!take_one(first + i) || exhausted())) return false;
  }
  return true;
}

bool ClearanceField::nearest(const glm::dvec3& point_m, double reach_m, glm::dvec3& surface_m) const {
  double best = reach_m;
  bool found = false;
  for_each_beside(Way(point_m, point_m, reach_m), [&](size_t index) {
    const Collider& collider = at(index);
    if (glm::distance(point_m, collider.center_m) - collider.radius_m > best) return true;
    const glm::dvec3 local = transform_point(collider.instance_from_world, point_m);
    const auto bound = [&](const Aabb& box) { return collider.min_stretch * distance_to_box(local, box); };
    const auto visit = [&](const Corners& t) {
      const Affine& map = collider.world_from_instance;
      const glm::dvec3 q = closest_on_triangle(point_m, transform_point(map, t[0]), transform_point(map, t[1]),
                                               transform_point(map, t[2]));
      const double distance = glm::distance(point_m, q);
      if (distance < best) best = distance, surface_m = q, found = true;
    };
    search(
        collider, bound, [&] { return best; }, visit);
    return true;
  });
  if (!exhausted()) return found;
  surface_m = point_m;
  return true;
}

// Calls visit(triangle, steps) for the triangles, in the world, of one collider that the sphere may touch before
// `limit()`, which may fall meanwhile. The visit adds its steps.
template <typename Limit, typename Visit>
void ClearanceField::sweep(const Collider& collider, const Way& way, Limit limit, Visit visit) const {
  const glm::dvec3 nearest_on_path = closest_on_segment(collider.center_m, way.from_m, way.to_m);
  if (glm::distance(nearest_on_path, collider.center_m) > collider.radius_m + way.radius_m) return;
  const Affine& map = collider.world_from_instance;
  const Path path(transform_point(collider.instance_from_world, way.from_m),
                  transform_vector(collider.instance_from_world, way.to_m - way.from_m),
                  (way.radius_m + kPruneSlackM) / collider.min_stretch);
  const auto in_world = [&](const Corners& t) {
    uint64_t steps = 0;
    visit(WorldTriangle{transform_point(map, t[0]), transform_point(map, t[1]), transform_point(map, t[2])}, steps);
    take(steps);
  };
  search(
      collider, [&](const Aabb& box) { return way.length_m * path.enters(box); }, limit, in_world);
}

double ClearanceField::free_fraction(const glm::dvec3& from_m, const glm::dvec3& to_m, double radius_m) const {
  const Way way(from_m, to_m, radius_m);
  // A path too short to have a direction is free when its start is.
  if (!(way.length_m > kTouchM)) return clearance_m(from_m, radius_m) < radius_m - kTouchM ? 0.0 : 1.0;
  double free = way.length_m;
  for_each_beside(way, [&](size_t index) {
    sweep(
        at(index), way, [&] { return free; },
        [&](const WorldTriangle& t, uint64_t& steps) {
          free = std::min(free, sweep_triangle(way.from_m, way.direction, free, radius_m, t, steps));
        });
    return true;
  });
  return exhausted() ? 0.0 : free / way.length_m;
}

std::optional<uint32_t> ClearanceField::first_in_way(const glm::dvec3& from_m, const glm::dvec3& to_m,
                                                     double radius_m) const {
  const Way way(from_m, to_m, radius_m);
  if (!(way.length_m > kTouchM)) return std::nullopt;
  double free = way.length_m;
  std::optional<uint32_t> first;
  for_each_beside(way, [&](size_t index) {
    sweep(
        at(index), way, [&] { return free; },
        [&](const WorldTriangle& t, uint64_t& steps) {
          const double moved = sweep_triangle(way.from_m, way.direction, free, radius_m, t, steps);
          if (moved < free) free = moved, first = at(index).slot;
        });
    return true;
  });
  return first;
}

bool ClearanceField::meets(const Collider& collider, const Way& way) const {
  const double pressed_m = std::max(way.radius_m - kTouchM, 0.0);
  bool met = false;
  sweep(
      collider, way, [&] { return met ? 0.0 : way.length_m; },
      [&](const WorldTriangle& t, uint64_t& steps) {
        met = met || advance(way.from_m, way.direction, way.length_m, pressed_m, t, steps) < way.length_m;
      });
  return met || exhausted();
}

bool ClearanceField::is_free(const glm::dvec3& from_m, const glm::dvec3& to_m, double radius_m, size_t& blocker) const {
  const Way way(from_m, to_m, radius_m);
  if (!(way.length_m > kTouchM)) return free_fraction(from_m, to_m, radius_m) >= 1.0;
  if (blocker < x_m_.size() && meets(at(blocker), way)) return false;
  return for_each_beside(way, [&](size_t index) {
    if (!meets(at(index), way)) return true;
    blocker = index;
    return false;
  });
}

}  // namespace sightline
