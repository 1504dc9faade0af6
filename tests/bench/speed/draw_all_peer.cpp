#include <cstddef>

#include "server/gl/egl_context.h"
#include "server/gl/gl_object.h"
#include "server/gl/program.h"
#include "server/sample/egl_sampler.h"
#include "tests/bench/speed/flat_triangles.h"
#include "tests/bench/speed/peers.h"

namespace sightline::bench {
namespace {

constexpr float kFarM = 2e4f;
constexpr const char* kVertexShader = R"(#version 450 core
layout(location = 0) in vec3 position;
layout(location = 0) uniform mat4 clip_from_mesh;
void main() { gl_Position = clip_from_mesh * vec4(position, 1.0); }
)";
constexpr const char* kFragmentShader = "#version 450 core\nvoid main() {}\n";

// An indexed mesh on the device.
struct Mesh {
  GlBuffer vertices = GlBuffer::create(), indices = GlBuffer::create();
  GlVertexArray array = GlVertexArray::create();
  GLsizei index_count = 0;

  explicit Mesh(const FlatTriangles& flat) : index_count(static_cast<GLsizei>(flat.indices.size())) {
    glNamedBufferStorage(vertices.name(), static_cast<GLsizeiptr>(flat.positions.size() * sizeof(glm::vec3)),
                         flat.positions.data(), 0);
    glNamedBufferStorage(indices.name(), static_cast<GLsizeiptr>(flat.indices.size() * sizeof(uint32_t)),
                         flat.indices.data(), 0);
    glVertexArrayVertexBuffer(array.name(), 0, vertices.name(), 0, sizeof(glm::vec3));
    glVertexArrayElementBuffer(array.name(), indices.name());
    glEnableVertexArrayAttrib(array.name(), 0);
    glVertexArrayAttribFormat(array.name(), 0, 3, GL_FLOAT, GL_FALSE, 0);
    glVertexArrayAttribBinding(array.name(), 0, 0);
  }
  void draw(const glm::mat4& clip_from_mesh) const {
    glUniformMatrix4fv(0, 1, GL_FALSE, &clip_from_mesh[0][0]);
    glBindVertexArray(array.name());
    glDrawElements(GL_TRIANGLES, index_count, GL_UNSIGNED_INT, nullptr);
  }
};

glm::dmat4 clip_from_world(const MapView& view) {
  const double near = view.near_m;
  const glm::dmat4 clip_from_view = glm::frustumRH_ZO(view.left * near, view.right * near, view.bottom * near,
                                                      view.top * near, near, double{kFarM});
  const glm::dmat3 turn = glm::transpose(view.world_from_view);
  glm::dmat4 view_from_world(turn);
  view_from_world[3] = glm::dvec4(-(turn * view.eye_m), 1.0);
  return clip_from_view * view_from_world;
}

class DrawAll final : public DrawAllPeer {
 public:
  DrawAll(const SceneMirror& mirror, std::unique_ptr<EglContext> context)
      : mirror_(mirror), context_(std::move(context)) {}
  ~DrawAll() override {
    const CurrentContext current(*context_);
    standing_.reset();
    movers_.clear();
    program_ = {}, depth_ = {}, framebuffer_ = {};
  }

  Status build() {
    const CurrentContext current(*context_);
    Result<GlProgram> program = make_program(kVertexShader, kFragmentShader);
    if (!program) return tl::unexpected(program.error());
    program_ = std::move(*program);
    standing_ = std::make_unique<Mesh>(flat_statics(mirror_));
    for (const uint32_t slot : moving_occluders(mirror_)) add_mover(slot);
    depth_ = GlTexture2dArray::create();
    glTextureStorage3D(depth_.name(), 1, GL_DEPTH_COMPONENT32F, kMaxMapSize, kMaxMapSize, 1);
    framebuffer_ = GlFramebuffer::create();
    glNamedFramebufferTextureLayer(framebuffer_.name(), GL_DEPTH_ATTACHMENT, depth_.name(), 0, 0);
    return {};
  }

  void take(std::span<const MapRequest> requests, std::vector<std::vector<float>>& depths) override {
    const CurrentContext current(*context_);
    glUseProgram(program_.name());
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.name());
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LESS);
    glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    depths.resize(requests.size());
    for (size_t i = 0; i < requests.size(); ++i) draw(requests[i], depths[i]);
  }

 private:
  void add_mover(uint32_t slot) {
    Instance at_origin = mirror_.instances()[slot];
    at_origin.world_from_instance = identity_affine();
    FlatTriangles flat;
    append_flat(at_origin, flat);
    movers_.push_back({slot, Mesh(flat)});
  }

  void draw(const MapRequest& request, std::vector<float>& depth) const {
    const MapView& view = request.view;
    glViewport(0, 0, view.width, view.height);
    glClearDepth(1.0);
    glClear(GL_DEPTH_BUFFER_BIT);
    const glm::dmat4 clip = clip_from_world(view);
    standing_->draw(glm::mat4(clip));
    for (const auto& [slot, mesh] : movers_) {
      if (std::binary_search(request.ignored_slots.begin(), request.ignored_slots.end(), slot)) continue;
      mesh.draw(glm::mat4(clip * glm::dmat4(mirror_.instances()[slot].world_from_instance)));
    }
    depth.resize(static_cast<size_t>(view.width) * static_cast<size_t>(view.height));
    glReadPixels(0, 0, view.width, view.height, GL_DEPTH_COMPONENT, GL_FLOAT, depth.data());
  }

  struct Mover {
    uint32_t slot;
    Mesh mesh;
  };
  const SceneMirror& mirror_;
  const std::unique_ptr<EglContext> context_;
  GlProgram program_;
  std::unique_ptr<Mesh> standing_;
  std::vector<Mover> movers_;
  GlTexture2dArray depth_;
  GlFramebuffer framebuffer_;
};

}  // namespace

Result<std::unique_ptr<DrawAllPeer>> make_draw_all_peer(const SceneMirror& mirror) {
  const Result<EglDeviceInfo> device = choose_egl_device({});
  if (!device) return tl::unexpected(device.error());
  auto context = EglContext::create(device->index);
  if (!context) return tl::unexpected(context.error());
  auto peer = std::make_unique<DrawAll>(mirror, std::move(*context));
  if (Status built = peer->build(); !built) return tl::unexpected(built.error());
  return peer;
}

}  // namespace sightline::bench
