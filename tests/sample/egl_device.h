// An EGL device for tests that need OpenGL; null with a reason when no context can be made at all.
#pragma once

#include <memory>
#include <string>

#include "server/gl/software_renderer.h"
#include "server/sample/egl_sampler.h"

namespace sightline::test {

struct EglForTests {
  std::unique_ptr<EglSamplerDevice> device;
  std::string why_not;
};

inline EglForTests make_egl_for_tests() {
  prepare_software_rendering();
  auto device = make_egl_sampler_device({});
  if (!device) return {nullptr, to_string(device.error())};
  return {std::move(*device), ""};
}

}  // namespace sightline::test

// At the start of a test body: declares the device under `name`, or skips the test.
#define SIGHTLINE_EGL_DEVICE_OR_SKIP(name)                                                \
  auto egl_for_tests = ::sightline::test::make_egl_for_tests();                           \
  if (!egl_for_tests.device) GTEST_SKIP() << "no EGL context: " << egl_for_tests.why_not; \
  ::sightline::EglSamplerDevice& name = *egl_for_tests.device
