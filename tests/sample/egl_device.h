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

// One way to take maps by default, so that a test does not depend on what is measured.
inline EglForTests make_egl_for_tests(const EglOptions& options = {.variant = EglVariant{}}) {
  prepare_software_rendering();
  auto device = make_egl_sampler_device(options);
  if (!device) return {nullptr, to_string(device.error())};
  return {std::move(*device), ""};
}

}  // namespace sightline::test

// At the start of a test body: declares it under `name`, or skips. Options may follow.
#define SIGHTLINE_EGL_DEVICE_OR_SKIP(name, ...)                                 \
  auto egl_for_tests = ::sightline::test::make_egl_for_tests(__VA_ARGS__);        \
  if (!egl_for_tests.device) GTEST_SKIP() << "no EGL context: " << egl_for_tests.why_not; \
  ::sightline::EglSamplerDevice& name = *egl_for_tests.device
