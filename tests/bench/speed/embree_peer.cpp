#include <algorithm>
#include <limits>

#include "server/sample/embree_query.h"
#include "tests/bench/speed/flat_triangles.h"
#include "tests/bench/speed/peers.h"

namespace sightline::bench {
namespace {

class EmbreePeer final : public RayPeer {
 public:
  explicit EmbreePeer(const SceneMirror& mirror)
      : mirror_(mirror), device_(rtcNewDevice(nullptr)), movers_(moving_occluders(mirror)) {
    standing_ = rtcNewScene(device_);
    add_triangles(standing_, flat_statics(mirror));
    rtcSetSceneBuildQuality(standing_, RTC_BUILD_QUALITY_HIGH);
    rtcCommitScene(standing_);
    moving_ = rtcNewScene(device_);
    rtcSetSceneFlags(moving_, RTC_SCENE_FLAG_DYNAMIC);
    rtcSetSceneBuildQuality(moving_, RTC_BUILD_QUALITY_LOW);
    for (size_t i = 0; i < movers_.size(); ++i) add_mover(mirror.instances()[movers_[i]], static_cast<unsigned>(i));
    prepare();
  }
  ~EmbreePeer() override {
    for (RTCGeometry instance : instances_) rtcReleaseGeometry(instance);
    for (RTCScene shape : shapes_) rtcReleaseScene(shape);
    rtcReleaseScene(moving_);
    rtcReleaseScene(standing_);
    rtcReleaseDevice(device_);
  }

  void prepare() override {
    for (size_t i = 0; i < movers_.size(); ++i) {
      const glm::mat4x3 world_from_instance(mirror_.instances()[movers_[i]].world_from_instance);
      rtcSetGeometryTransform(instances_[i], 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, &world_from_instance[0].x);
      rtcCommitGeometry(instances_[i]);
    }
    rtcCommitScene(moving_);
  }

  void look(std::span<const SeenFrom> targets, std::span<const glm::dvec3> candidates_m,
            std::vector<uint32_t>& seen) override {
    seen.assign(candidates_m.size(), 0);
    for (size_t t = 0; t < targets.size(); ++t) {
      hide_only(targets[t].slot);
      const glm::vec3 from(targets[t].aim_m);
      for (size_t k = 0; k < candidates_m.size(); ++k)
        if (!is_blocked(from, glm::vec3(candidates_m[k]))) seen[k] |= 1u << t;
    }
  }

 private:
  // A target is left out of its own rays by their mask.
  void hide_only(uint32_t slot) { own_ = std::find(movers_.begin(), movers_.end(), slot) - movers_.begin(); }

  bool is_blocked(const glm::vec3& from, const glm::vec3& to) const {
    const glm::vec3 way = to - from;
    RTCRay ray{from.x, from.y, from.z, 0.0f, way.x, way.y, way.z, 0.0f, 1.0f, ~0u, 0, 0};
    Context context;
    context.query.occluded(standing_, ray);
    if (ray.tfar < 0 || movers_.empty()) return ray.tfar < 0;
    context.own = static_cast<unsigned>(own_);
    context.query.filter_by(leave_out_own);
    context.query.occluded(moving_, ray);
    return ray.tfar < 0;
  }

  struct Context {
    QueryContext query;  // must stay first
    unsigned own = 0;
  };
  static void leave_out_own(const RTCFilterFunctionNArguments* args) {
    const auto* context = reinterpret_cast<const Context*>(args->context);
    if (args->context->instID[0] == context->own) args->valid[0] = 0;
  }

  void add_triangles(RTCScene scene, const FlatTriangles& flat) {
    RTCGeometry mesh = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                                 sizeof(glm::vec3), flat.positions.size()));
    auto* indices = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                   3 * sizeof(uint32_t), flat.indices.size() / 3));
    std::copy_n(&flat.positions[0].x, 3 * flat.positions.size(), vertices);
    std::copy(flat.indices.begin(), flat.indices.end(), indices);
    rtcSetGeometryMask(mesh, ~0u);
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    rtcReleaseGeometry(mesh);
  }

  void add_mover(const Instance& mover, unsigned id) {
    Instance at_origin = mover;
    at_origin.world_from_instance = identity_affine();
    FlatTriangles flat;
    append_flat(at_origin, flat);
    RTCScene shape = rtcNewScene(device_);
    add_triangles(shape, flat);
    rtcSetSceneFlags(shape, kFilterByQuery);
    rtcCommitScene(shape);
    RTCGeometry instance = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(instance, shape);
    rtcSetGeometryMask(instance, ~0u);
    rtcCommitGeometry(instance);
    rtcAttachGeometryByID(moving_, instance, id);
    shapes_.push_back(shape);
    instances_.push_back(instance);
  }

  const SceneMirror& mirror_;
  RTCDevice device_;
  RTCScene standing_, moving_;
  const std::vector<uint32_t> movers_;
  std::vector<RTCScene> shapes_;
  std::vector<RTCGeometry> instances_;
  ptrdiff_t own_ = 0;
};

}  // namespace

std::unique_ptr<RayPeer> make_embree_peer(const SceneMirror& mirror) {
  return std::make_unique<EmbreePeer>(mirror);
}

}  // namespace sightline::bench
