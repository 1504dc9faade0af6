#include <btBulletCollisionCommon.h>

#include <map>

#include "tests/bench/speed/flat_triangles.h"
#include "tests/bench/speed/peers.h"

namespace sightline::bench {
namespace {

btVector3 to_bullet(const glm::dvec3& v) {
  return {static_cast<btScalar>(v.x), static_cast<btScalar>(v.y), static_cast<btScalar>(v.z)};
}

// Finds whether anything but `own` blocks the ray. Bullet has no query that stops at the first hit found. So a hit sets
// the closest fraction to end the search for nearer ones at once.
struct AnyHit final : btCollisionWorld::RayResultCallback {
  explicit AnyHit(const btCollisionObject* own_object) : own(own_object) {}
  bool needsCollision(btBroadphaseProxy* proxy) const override { return proxy->m_clientObject != own; }
  btScalar addSingleResult(btCollisionWorld::LocalRayResult& result, bool) override {
    m_collisionObject = result.m_collisionObject;
    m_closestHitFraction = 0;
    return 0;
  }
  const btCollisionObject* own;
};

class BulletPeer final : public RayPeer {
 public:
  explicit BulletPeer(const SceneMirror& mirror)
      : mirror_(mirror), dispatcher_(&configuration_), world_(&dispatcher_, &broadphase_, &configuration_) {
    for (uint32_t slot = 0; slot < mirror.instances().size(); ++slot) {
      const Instance& instance = mirror.instances()[slot];
      if (instance.geometry && instance.occludes() && instance.geometry->occluding_index_count > 0) add(instance, slot);
    }
    world_.updateAabbs();
  }
  ~BulletPeer() override {
    for (auto& [slot, object] : objects_) world_.removeCollisionObject(object.get());
  }

  void prepare() override {
    for (const uint32_t slot : mirror_.moving_slots()) {
      const auto found = objects_.find(slot);
      if (found == objects_.end()) continue;
      found->second->setWorldTransform(placed(mirror_.instances()[slot]));
      world_.updateSingleAabb(found->second.get());
    }
  }

  void look(std::span<const SeenFrom> targets, std::span<const glm::dvec3> candidates_m,
            std::vector<uint32_t>& seen) override {
    seen.assign(candidates_m.size(), 0);
    for (size_t t = 0; t < targets.size(); ++t) {
      const auto own = objects_.find(targets[t].slot);
      const btVector3 from = to_bullet(targets[t].aim_m);
      for (size_t k = 0; k < candidates_m.size(); ++k) {
        const btVector3 to = to_bullet(candidates_m[k]);
        AnyHit hit(own == objects_.end() ? nullptr : own->second.get());
        world_.rayTest(from, to, hit);
        if (!hit.hasHit()) seen[k] |= 1u << t;
      }
    }
  }

 private:
  struct Shape {
    FlatTriangles triangles;
    std::unique_ptr<btTriangleIndexVertexArray> view;
    std::unique_ptr<btBvhTriangleMeshShape> mesh;
  };
  using ShapeKey = std::pair<const Geometry*, std::array<double, 9>>;

  static btTransform placed(const Instance& instance) {
    const glm::dquat& q = instance.pose.rotation;
    return btTransform(btQuaternion(static_cast<btScalar>(q.x), static_cast<btScalar>(q.y), static_cast<btScalar>(q.z),
                                    static_cast<btScalar>(q.w)),
                       to_bullet(instance.pose.position_m));
  }

  // Instances of one geometry share their shape; scaled instances have a shape of their own with the scale baked in.
  btBvhTriangleMeshShape* shape_of(const Instance& instance) {
    ShapeKey key{instance.geometry.get(), {}};
    for (int i = 0; i < 9; ++i) key.second[static_cast<size_t>(i)] = instance.linear[i / 3][i % 3];
    Shape& shape = shapes_[key];
    if (shape.mesh) return shape.mesh.get();
    Instance at_origin = instance;
    at_origin.world_from_instance = Affine(instance.linear[0], instance.linear[1], instance.linear[2], glm::dvec3(0.0));
    append_flat(at_origin, shape.triangles);
    auto* indices = reinterpret_cast<int*>(shape.triangles.indices.data());
    shape.view = std::make_unique<btTriangleIndexVertexArray>(
        static_cast<int>(shape.triangles.indices.size() / 3), indices, 3 * static_cast<int>(sizeof(int)),
        static_cast<int>(shape.triangles.positions.size()), &shape.triangles.positions[0].x,
        static_cast<int>(sizeof(glm::vec3)));
    shape.mesh = std::make_unique<btBvhTriangleMeshShape>(shape.view.get(), true);
    return shape.mesh.get();
  }

  void add(const Instance& instance, uint32_t slot) {
    auto object = std::make_unique<btCollisionObject>();
    object->setCollisionShape(shape_of(instance));
    object->setWorldTransform(placed(instance));
    const int group = instance.moving ? btBroadphaseProxy::KinematicFilter : btBroadphaseProxy::StaticFilter;
    world_.addCollisionObject(object.get(), group, btBroadphaseProxy::AllFilter);
    objects_.emplace(slot, std::move(object));
  }

  const SceneMirror& mirror_;
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_;
  btDbvtBroadphase broadphase_;
  std::map<ShapeKey, Shape> shapes_;
  std::map<uint32_t, std::unique_ptr<btCollisionObject>> objects_;  // by slot
  btCollisionWorld world_;
};

}  // namespace

std::unique_ptr<RayPeer> make_bullet_peer(const SceneMirror& mirror) {
  return std::make_unique<BulletPeer>(mirror);
}

}  // namespace sightline::bench
