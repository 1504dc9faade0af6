#include "server/scene/geometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <set>
#include <thread>

#include "server/base/random.h"
#include "tests/support/triangles.h"

namespace sightline {
namespace {

// Separate triangles of about `size_m` in a box of 20 m.
MeshData random_soup(uint64_t seed, uint32_t triangles, double size_m = 1.0) {
  CounterRandom random(seed, 0, RandomPurpose::kTest);
  const auto vec = [&](double range) {
    return glm::vec3(random.next_in(-range, range), random.next_in(-range, range), random.next_in(-range, range));
  };
  MeshData mesh;
  for (uint32_t t = 0; t < triangles; ++t) {
    const glm::vec3 at = vec(10);
    for (uint32_t k = 0; k < 3; ++k) {
      mesh.positions.push_back(at + vec(size_m));
      mesh.indices.push_back(3 * t + k);
    }
  }
  return mesh;
}

std::shared_ptr<const Geometry> build(const MeshData& mesh) {
  return build_geometry(mesh).value();
}

using Corners = std::array<uint32_t, 3>;

std::vector<Corners> sorted_triangles(std::span<const uint32_t> indices) {
  std::vector<Corners> triangles;
  for (size_t i = 0; i < indices.size(); i += 3) triangles.push_back({indices[i], indices[i + 1], indices[i + 2]});
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

bool inside(const glm::vec3& p, const Aabb& box) {
  return glm::all(glm::greaterThanEqual(p, box.min)) && glm::all(glm::lessThanEqual(p, box.max));
}

// Walks a tree by the rules of the header; returns the depth. Leaves must follow each other without gap.
int check_tree(const Geometry& g, const TriangleTree& tree, uint32_t node, uint32_t& next_index) {
  const TreeNode& n = tree.at(node);
  EXPECT_EQ(n.first_index, next_index);
  for (uint32_t i = n.first_index; i < n.first_index + n.index_count; ++i)
    EXPECT_TRUE(inside(g.positions[g.indices.at(i)], n.bounds));
  if (n.is_leaf()) {
    EXPECT_GT(n.index_count, 0u);
    EXPECT_EQ(n.index_count % 3, 0u);
    EXPECT_LE(n.index_count / 3, kMaxClusterTriangles);
    next_index += n.index_count;
    return 0;
  }
  const TreeNode &left = tree.at(node + 1), &right = tree.at(n.right);
  EXPECT_EQ(left.index_count + right.index_count, n.index_count);
  const int depth_left = check_tree(g, tree, node + 1, next_index);
  return 1 + std::max(depth_left, check_tree(g, tree, n.right, next_index));
}

void check_trees(const Geometry& g) {
  uint32_t next = 0;
  const auto depth = [&](const TriangleTree& tree) { return tree.empty() ? 0 : check_tree(g, tree, 0, next); };
  EXPECT_LE(depth(g.occluding), kMaxTreeDepth);
  EXPECT_EQ(next, g.occluding_index_count);
  EXPECT_LE(depth(g.see_through), kMaxTreeDepth);
  EXPECT_EQ(next, g.indices.size());
}

TEST(Geometry, EveryTriangleStandsInExactlyOneLeafWhoseBoundsContainIt) {
  for (const uint32_t count : {1u, 2u, 63u, 64u, 65u, 128u, 129u, 1000u, 20'000u}) {
    const MeshData mesh = random_soup(count, count);
    const auto g = build(mesh);
    EXPECT_EQ(sorted_triangles(g->indices), sorted_triangles(mesh.indices));
    check_trees(*g);
  }
}

TEST(Geometry, ClustersAreAtLeastHalfFullOnAverage) {
  const auto g = build(random_soup(7, 20'000));
  const auto leaves = std::count_if(g->occluding.begin(), g->occluding.end(),
                                    [](const TreeNode& n) { return n.is_leaf(); });
  EXPECT_LT(static_cast<size_t>(leaves), g->triangle_count() / (kMaxClusterTriangles / 2));
}

TEST(Geometry, TheTreeSeparatesSpace) {
  // A node of a useful tree is far smaller than the whole: here 313 clusters would ideally be 1/7 as wide
  // each.
  const auto g = build(random_soup(8, 20'000, 0.05));
  double volume = 0, count = 0;
  for (const TreeNode& n : g->occluding)
    if (n.is_leaf()) {
      const glm::vec3 d = n.bounds.max - n.bounds.min;
      volume += d.x * d.y * d.z, ++count;
    }
  EXPECT_LT(volume / count, 20.0 * 20.0 * 20.0 / 150);
}

TEST(Geometry, SphereAndBoxContainEveryVertexOfATriangle) {
  const auto g = build(random_soup(9, 500));
  double farthest = 0;
  for (const uint32_t i : g->indices) {
    EXPECT_TRUE(inside(g->positions[i], g->bounds));
    const double d = glm::distance(glm::dvec3(g->positions[i]), glm::dvec3(g->center));
    EXPECT_LE(d, g->radius_m);
    farthest = std::max(farthest, d);
  }
  EXPECT_NEAR(g->radius_m, farthest, 1e-5);
}

TEST(Geometry, UnusedVerticesDoNotWidenTheBounds) {
  MeshData mesh = random_soup(10, 10);
  const auto before = build(mesh);
  mesh.positions.emplace_back(1000.0f);
  const auto after = build(mesh);
  EXPECT_EQ(after->bounds.max, before->bounds.max);
  EXPECT_EQ(after->radius_m, before->radius_m);
}

TEST(Geometry, TrianglesWithoutAreaAreDropped) {
  MeshData mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 0, 0}, {1, 0, 0}};
  mesh.indices = {0, 1, 2, /*corner twice*/ 0, 1, 1, /*on a line*/ 0, 1, 3, /*equal positions*/ 1, 4, 2};
  const auto g = build(mesh);
  EXPECT_EQ(sorted_triangles(g->indices), (std::vector<Corners>{{0, 1, 2}}));
  check_trees(*g);
}

TEST(Geometry, NothingButDegenerateTrianglesGivesAnEmptyGeometry) {
  MeshData mesh;
  mesh.positions = {{3, 3, 3}};
  mesh.indices = {0, 0, 0};
  for (const MeshData& m : {mesh, MeshData{}}) {
    const auto g = build(m);
    EXPECT_EQ(g->triangle_count(), 0u);
    EXPECT_TRUE(g->occluding.empty() && g->see_through.empty() && g->bounds.empty());
    EXPECT_EQ(g->radius_m, 0.0f);
  }
}

TEST(Geometry, SeeThroughTrianglesHaveATreeOfTheirOwn) {
  MeshData mesh = random_soup(11, 500);
  mesh.see_through_first_index = 3 * 300;
  const auto g = build(mesh);
  EXPECT_EQ(g->occluding_index_count, 3u * 300);
  const std::span<const uint32_t> all(g->indices), given(mesh.indices);
  EXPECT_EQ(sorted_triangles(all.first(900)), sorted_triangles(given.first(900)));
  EXPECT_EQ(sorted_triangles(all.subspan(900)), sorted_triangles(given.subspan(900)));
  check_trees(*g);
  mesh.see_through_first_index = 0;
  EXPECT_TRUE(build(mesh)->occluding.empty());
}

TEST(Geometry, EqualInputGivesEqualOutput) {
  const MeshData mesh = random_soup(12, 5000);
  const auto a = build(mesh), b = build(mesh);
  EXPECT_EQ(a->hash, b->hash);
  EXPECT_EQ(a->indices, b->indices);
  ASSERT_EQ(a->occluding.size(), b->occluding.size());
  for (size_t i = 0; i < a->occluding.size(); ++i) {
    EXPECT_EQ(a->occluding[i].first_index, b->occluding[i].first_index);
    EXPECT_EQ(a->occluding[i].bounds.min, b->occluding[i].bounds.min);
  }
}

TEST(Geometry, TheHashTellsPositionsIndicesAndSplitApart) {
  const MeshData mesh = random_soup(13, 4);
  MeshData moved = mesh, turned = mesh, split = mesh;
  moved.positions[5].y = std::nextafter(moved.positions[5].y, 100.0f);
  std::swap(turned.indices[0], turned.indices[1]);
  split.see_through_first_index = 3;
  const std::set<ContentHash> hashes = {hash_mesh(mesh), hash_mesh(moved), hash_mesh(turned), hash_mesh(split)};
  EXPECT_EQ(hashes.size(), 4u);
  MeshData same_split = mesh;
  same_split.see_through_first_index = 12;  // beyond the end, as by default
  EXPECT_EQ(hash_mesh(same_split), hash_mesh(mesh));
}

// Meshes that are made to unbalance or break a tree builder.
TEST(Geometry, HostileShapesKeepTheDepthBounded) {
  std::vector<MeshData> meshes(4);
  for (uint32_t t = 0; t < 20'000; ++t) {
    const uint32_t i = 3 * t;
    const float spread = std::ldexp(1.0f, -static_cast<int>(t % 100)), far = std::ldexp(1.0f, static_cast<int>(t % 29));
    // In turn: all in one place; ever closer to a point; ever farther away; all centroids equal but sizes unlike.
    const auto add = [&](MeshData& mesh, const glm::vec3& at, float size) {
      mesh.positions.insert(mesh.positions.end(), {at, at + glm::vec3(size, 0, 0), at + glm::vec3(0, size, size)});
      mesh.indices.insert(mesh.indices.end(), {i, i + 1, i + 2});
    };
    add(meshes[0], glm::vec3(1), 1);
    add(meshes[1], glm::vec3(spread, 0, 0), spread);
    add(meshes[2], glm::vec3(far), 1e-3f * far);
    add(meshes[3], glm::vec3(-0.5f * far), far);
  }
  for (const MeshData& mesh : meshes) check_trees(*build(mesh));
}

// Single triangles on the three axes, each 32 times nearer to the origin than the one before. Every split by the
// heuristic separates one triangle, 78 times in a row.
TEST(Geometry, NestedScalesKeepTheDepthBounded) {
  MeshData mesh;
  const auto add = [&](const glm::vec3& at) {
    const auto i = static_cast<uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {at, at + glm::vec3(1e-32f, 0, 0), at + glm::vec3(0, 1e-32f, 1e-32f)});
    mesh.positions[i + 1][at.x != 0 ? 1 : 0] += 1e-32f;  // off the axis, where it is not rounded away
    mesh.positions[i + 2][at.z != 0 ? 0 : 2] += 1e-32f;
    mesh.indices.insert(mesh.indices.end(), {i, i + 1, i + 2});
  };
  for (int level = 0; level < 26; ++level)
    for (int axis = 0; axis < 3; ++axis) {
      glm::vec3 at(0.0f);
      at[axis] = std::ldexp(1.0f, 29 - 5 * level);
      add(at);
    }
  for (int i = 0; i < 200; ++i) add(glm::vec3(0.0f));
  const auto g = build(mesh);
  EXPECT_EQ(g->triangle_count(), 278u);
  check_trees(*g);
}

void expect_refused(const MeshData& mesh, const std::string& field) {
  const auto result = build_geometry(mesh);
  ASSERT_FALSE(result) << field;
  EXPECT_EQ(result.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(result.error().field, field);
  GeometryStore store;
  ASSERT_FALSE(store.intern(mesh));
  EXPECT_EQ(store.live_count(), 0u);
}

TEST(Geometry, BadMeshesAreRefusedByField) {
  const MeshData good = random_soup(14, 3);
  const auto with = [&](const std::function<void(MeshData&)>& spoil) {
    MeshData mesh = good;
    spoil(mesh);
    return mesh;
  };
  expect_refused(with([](MeshData& m) { m.indices.pop_back(); }), "indices");
  expect_refused(with([](MeshData& m) { m.indices[4] = 9; }), "indices[4]");
  expect_refused(with([](MeshData& m) { m.indices[8] = UINT32_MAX; }), "indices[8]");
  expect_refused(with([](MeshData& m) { m.positions[2].x = NAN; }), "positions[2]");
  expect_refused(with([](MeshData& m) { m.positions[0].z = -INFINITY; }), "positions[0]");
  expect_refused(with([](MeshData& m) { m.positions[1].y = 2e9f; }), "positions[1]");
  expect_refused(with([](MeshData& m) { m.see_through_first_index = 4; }), "see_through_first_index");
}

// Large enough that threads build subtrees of their own.
TEST(Geometry, ALargeMeshGivesTheSameTreeEveryTime) {
  const MeshData mesh = random_soup(11, 150'000, 0.2);
  const auto first = build(mesh), second = build(mesh);
  EXPECT_EQ(sorted_triangles(first->indices), sorted_triangles(mesh.indices));
  check_trees(*first);
  EXPECT_EQ(first->indices, second->indices);
  ASSERT_EQ(first->occluding.size(), second->occluding.size());
  EXPECT_EQ(std::memcmp(first->occluding.data(), second->occluding.data(), first->occluding.size() * sizeof(TreeNode)),
            0);
}

TEST(Geometry, BytesAreReportedByPart) {
  const auto g = build(random_soup(12, 500));
  EXPECT_EQ(g->bytes_by_part().source, 1500u * 12 + 1500u * 4);
  EXPECT_EQ(g->bytes_by_part().clusters, sizeof(Geometry) + g->occluding.size() * sizeof(TreeNode));
  EXPECT_EQ(g->bytes(), g->bytes_by_part().source + g->bytes_by_part().clusters);
}

// A grid with three vertices of its own for each triangle, as flat shading has it, and one vertex that nothing uses.
TEST(Geometry, EqualPositionsAreWelded) {
  MeshData grid{{glm::vec3(50.0f)}, {}};
  for (uint32_t j = 0; j < 20; ++j)
    for (uint32_t i = 0; i < 20; ++i) {
      const auto corner = [&](uint32_t di, uint32_t dj) {
        grid.indices.push_back(static_cast<uint32_t>(grid.positions.size()));
        grid.positions.push_back({i + di, 0.1f * static_cast<float>((i + di) * (j + dj)), j + dj});
      };
      corner(0, 0), corner(0, 1), corner(1, 0);
      corner(1, 0), corner(0, 1), corner(1, 1);
    }
  const auto g = build(grid);
  EXPECT_EQ(g->positions.size(), 21u * 21 + 1);
  EXPECT_EQ(triangles_of(*g), triangles_of(grid));
  EXPECT_EQ(g->hash, hash_mesh(grid));
}

// Equal positions stand far apart in the file.
TEST(Geometry, ManyCopiesOfManyPositionsAreWelded) {
  MeshData mesh = random_soup(14, 5000);
  const size_t once = mesh.positions.size();
  for (int copy = 0; copy < 3; ++copy)
    for (size_t i = 0; i < once; ++i) {
      mesh.indices.push_back(static_cast<uint32_t>(mesh.positions.size()));
      mesh.positions.push_back(mesh.positions[i]);
    }
  const auto g = build(mesh);
  EXPECT_EQ(g->positions.size(), once);
  EXPECT_EQ(triangles_of(*g), triangles_of(mesh));
}

// Computed with Python's hashlib: three sizes, positions and indices, little-endian.
TEST(Geometry, ItsKeyIsASha256OfItsData) {
  MeshData mesh{.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, .indices = {0, 1, 2}};
  const auto hex = [](const GeometryKey& key) {
    std::string text;
    for (const unsigned char byte : key) {
      text += "0123456789abcdef"[byte >> 4];
      text += "0123456789abcdef"[byte & 15];
    }
    return text;
  };
  EXPECT_EQ(hex(build(mesh)->key), "6e6e832043d86cde2bf5083c3be50fe642aeb7c623dc661c94c929b66f74688a");
  EXPECT_EQ(GeometryStore().intern(mesh).value()->key, build(mesh)->key);
  mesh.see_through_first_index = 0;
  EXPECT_NE(build(mesh)->key, build({.positions = mesh.positions, .indices = mesh.indices})->key);
}

TEST(GeometryStore, KeepsOneCopyOfEqualContent) {
  GeometryStore store;
  const auto a = store.intern(random_soup(1, 100)).value(), b = store.intern(random_soup(1, 100)).value();
  const auto other = store.intern(random_soup(2, 100)).value();
  EXPECT_EQ(a, b);
  EXPECT_NE(a, other);
  EXPECT_EQ(store.live_count(), 2u);
  EXPECT_EQ(store.live_bytes(), a->bytes() + other->bytes());
  EXPECT_EQ(store.live_bytes_by_part().source, a->bytes_by_part().source + other->bytes_by_part().source);
  EXPECT_EQ(a->hash, build(random_soup(1, 100))->hash);
}

TEST(GeometryStore, HasABoundedMemory) {
  GeometryStore store(1 << 20);
  auto first = store.intern(random_soup(1, 12'000));
  ASSERT_TRUE(first);
  const auto refused = store.intern(random_soup(2, 12'000));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kResourceExhausted);
  EXPECT_NE(refused.error().message.find("(--geometry-memory-mib)"), std::string::npos);
  EXPECT_TRUE(store.intern(random_soup(1, 12'000)));  // it is there
  *first = nullptr;
  EXPECT_TRUE(store.intern(random_soup(2, 12'000)));
}

TEST(GeometryStore, FreesGeometryThatNoOwnerHolds) {
  GeometryStore store;
  auto a = store.intern(random_soup(1, 100)).value();
  const std::weak_ptr<const Geometry> watch = a;
  a.reset();
  EXPECT_TRUE(watch.expired());
  EXPECT_EQ(store.live_count(), 0u);
  EXPECT_EQ(store.live_bytes(), 0u);
  EXPECT_TRUE(store.intern(random_soup(1, 100)));
}

TEST(GeometryStore, LivingGeometryIsFoundAfterManyHaveComeAndGone) {
  GeometryStore store;
  const auto kept = store.intern(random_soup(0, 2)).value();
  for (uint64_t seed = 1; seed < 1000; ++seed) ASSERT_TRUE(store.intern(random_soup(seed, 1)));
  EXPECT_EQ(store.live_count(), 1u);
  EXPECT_EQ(store.intern(random_soup(0, 2)).value(), kept);
}

TEST(GeometryStore, OutlivedGeometryStaysGood) {
  auto store = std::make_unique<GeometryStore>();
  const auto g = store->intern(random_soup(3, 100)).value();
  store.reset();
  check_trees(*g);
}

TEST(GeometryStore, ThreadsThatAskAtOnceShareOneCopy) {
  GeometryStore store;
  std::vector<std::shared_ptr<const Geometry>> got(8);
  std::vector<std::thread> threads;
  for (auto& g : got) threads.emplace_back([&store, &g] { g = store.intern(random_soup(4, 3000)).value(); });
  for (std::thread& t : threads) t.join();
  for (const auto& g : got) EXPECT_EQ(g, got.front());
  EXPECT_EQ(store.live_count(), 1u);
}

}  // namespace
}  // namespace sightline
