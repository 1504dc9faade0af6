#include <epoxy/egl.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <thread>

#include "server/gl/egl_context.h"
#include "server/gl/program.h"
#include "server/gl/software_renderer.h"

namespace sightline {
namespace {

// The first context that can be created; null when none can.
std::unique_ptr<EglContext> any_context() {
  prepare_software_rendering();
  for (int index = egl_device_count() - 1; index >= kSurfacelessIndex; --index)
    if (auto context = EglContext::create(index)) return std::move(*context);
  return nullptr;
}

TEST(EglContextTest, HasOpenGl45AndSaysWhatItIs) {
  const auto context = any_context();
  if (!context) GTEST_SKIP() << "no EGL context";
  const CurrentContext current(*context);
  ASSERT_TRUE(current);
  EXPECT_GE(epoxy_gl_version(), 45);
  EXPECT_FALSE(context->info().renderer.empty());
  EXPECT_EQ(context->info().platform, context->info().index == kSurfacelessIndex ? "surfaceless" : "device");
  EXPECT_EQ(context->info().software, is_software_renderer(context->info().renderer));
  EXPECT_EQ(context->info().drm_node, egl_drm_node(context->info().index));
  EXPECT_GE(std::stod(context->info().gl_version), 4.5);
  GLint strategy = 0;
  glGetIntegerv(GL_RESET_NOTIFICATION_STRATEGY, &strategy);
  EXPECT_EQ(context->info().robust, strategy == GL_LOSE_CONTEXT_ON_RESET);
  EXPECT_FALSE(context->was_reset());
}

// tests/run.sh installs Mesa and sets the variable. Without this test, a defect that finds no context would skip every
// test of OpenGL.
TEST(EglContextTest, IsThereWhereItIsRequired) {
  if (!std::getenv("SIGHTLINE_REQUIRE_EGL")) GTEST_SKIP() << "SIGHTLINE_REQUIRE_EGL is not set";
  EXPECT_NE(any_context(), nullptr);
}

TEST(EglContextTest, IsRefusedToASecondThreadWhileItIsCurrentOnOne) {
  const auto context = any_context();
  if (!context) GTEST_SKIP() << "no EGL context";
  bool second = true, later = false;
  {
    const CurrentContext current(*context);
    ASSERT_TRUE(current);
    std::thread([&] { second = static_cast<bool>(CurrentContext(*context)); }).join();
  }
  std::thread([&] { later = static_cast<bool>(CurrentContext(*context)); }).join();
  EXPECT_FALSE(second);
  EXPECT_TRUE(later);
}

TEST(EglContextTest, AnIndexWithoutADeviceIsUnavailable) {
  const auto context = EglContext::create(egl_device_count());
  ASSERT_FALSE(context);
  EXPECT_EQ(context.error().code, ErrorCode::kUnavailable);
  for (const int index : {-1, egl_device_count(), egl_device_count() + 1}) EXPECT_EQ(egl_drm_node(index), "") << index;
}

// A machine without a GPU has no device with a DRM node, so this stands in for a driver's. Epoxy calls EGL through
// variables.
class DrmNodeTest : public testing::Test {
 protected:
  void SetUp() override {
    if (egl_device_count() < 1) GTEST_SKIP() << "no EGL device";
    driver_ = epoxy_eglQueryDeviceStringEXT;
    epoxy_eglQueryDeviceStringEXT = [](EGLDeviceEXT, EGLint name) -> const char* {
      constexpr EGLint kRenderNode = 0x3377;  // EGL_DRM_RENDER_NODE_FILE_EXT
      if (name == EGL_EXTENSIONS) return extensions;
      if (name == kRenderNode) return render_node;
      return name == EGL_DRM_DEVICE_FILE_EXT ? "/dev/dri/card0" : nullptr;
    };
  }
  void TearDown() override {
    if (driver_) epoxy_eglQueryDeviceStringEXT = driver_;
  }

  static inline const char *extensions = "", *render_node = nullptr;

 private:
  decltype(epoxy_eglQueryDeviceStringEXT) driver_ = nullptr;
};

TEST_F(DrmNodeTest, IsTheRenderNodeOrElseTheCard) {
  render_node = "/dev/dri/renderD128";
  for (const char* words : {"EGL_EXT_device_drm EGL_EXT_device_drm_render_node",
                            "EGL_EXT_device_drm_render_node EGL_EXT_device_drm", "EGL_EXT_device_drm_render_node"}) {
    extensions = words;
    EXPECT_EQ(egl_drm_node(0), "/dev/dri/renderD128") << words;
  }
  for (const char* words : {"EGL_EXT_device_drm", "EGL_EXT_device_query EGL_EXT_device_drm EGL_NV_device_cuda"}) {
    extensions = words;
    EXPECT_EQ(egl_drm_node(0), "/dev/dri/card0") << words;
  }
  render_node = nullptr;
  extensions = "EGL_EXT_device_drm EGL_EXT_device_drm_render_node";
  EXPECT_EQ(egl_drm_node(0), "/dev/dri/card0");
}

TEST_F(DrmNodeTest, IsAskedForOnlyWithTheExtension) {
  render_node = "/dev/dri/renderD128";
  for (const char* words : {static_cast<const char*>(nullptr), "", "EGL_EXT_device_drm_render_nodes",
                            "EGL_NV_device_cuda XEGL_EXT_device_drm"}) {
    extensions = words;
    EXPECT_EQ(egl_drm_node(0), "") << (words ? words : "none");
  }
}

TEST(ProgramTest, CompilerComplaintsAreValuesThatNameTheStage) {
  const auto context = any_context();
  if (!context) GTEST_SKIP() << "no EGL context";
  const CurrentContext current(*context);
  const std::string vertex = "#version 450 core\nout vec4 a; void main() { gl_Position = a = vec4(1); }";
  const std::string fragment = "#version 450 core\nin vec4 a; out vec4 c; void main() { c = a; }";
  EXPECT_TRUE(make_program(vertex, fragment));
  EXPECT_EQ(make_program("nonsense", fragment).error().field, "vertex shader");
  EXPECT_EQ(make_program(vertex, "#version 450 core\nvoid main() { missing(); }").error().field, "fragment shader");
  const auto unlinked = make_program(vertex, "#version 450 core\nin vec2 a; out vec4 c; void main() { c = a.xyxy; }");
  ASSERT_FALSE(unlinked);
  EXPECT_EQ(unlinked.error().field, "program");
  EXPECT_FALSE(unlinked.error().message.empty());
}

TEST(SoftwareRendererTest, KnowsMesasNames) {
  EXPECT_TRUE(is_software_renderer("llvmpipe (LLVM 15.0.6, 256 bits)"));
  EXPECT_TRUE(is_software_renderer("softpipe"));
  EXPECT_TRUE(is_software_renderer("Gallium 0.4 on swrast"));
  EXPECT_FALSE(is_software_renderer("NVIDIA H200/PCIe/SSE2"));
  EXPECT_FALSE(is_software_renderer("Mesa Intel(R) Graphics (ADL GT2)"));
}

TEST(SoftwareRendererTest, TheEnvironmentsOwnValuesStand) {
  ASSERT_EQ(setenv("LP_NUM_THREADS", "7", 1), 0);
  prepare_software_rendering();
  EXPECT_STREQ(getenv("LP_NUM_THREADS"), "7");
  unsetenv("LP_NUM_THREADS");
  unsetenv("MESA_SHADER_CACHE_DISABLE");
  prepare_software_rendering();
  EXPECT_STRNE(getenv("LP_NUM_THREADS"), nullptr);
  EXPECT_STREQ(getenv("MESA_SHADER_CACHE_DISABLE"), "true") << "nothing is written into the home folder";
}

}  // namespace
}  // namespace sightline
