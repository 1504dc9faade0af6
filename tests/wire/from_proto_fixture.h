// Reads messages as the service does, without one.
#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "server/wire/from_proto.h"
#include "tests/support/glb_builder.h"
#include "tests/support/temporary_folder.h"
#include "tests/wire/wire.h"

namespace sightline::test {

// A folder with town.glb: "house" and "cart" are triangles at (10, 0, 0) and (0, 0, 20).
inline std::vector<std::byte> town_glb() {
  GlbBuilder file;
  const int house = file.triangle_node(), cart = file.triangle_node();
  file.json["nodes"][house].update({{"name", "house"}, {"translation", {10, 0, 0}}});
  file.json["nodes"][cart].update({{"name", "cart"}, {"translation", {0, 0, 20}}});
  file.json["meshes"][0]["name"] = "gable";
  file.json["meshes"][1]["name"] = "gable two";
  return file.glb();
}

class FromProto : public testing::Test {
 protected:
  FromProto() {
    std::ofstream out(folder / "town.glb", std::ios::binary);
    const auto bytes = town_glb();
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  Result<SessionOptions> read(const v1::OpenSession& open) {
    return session_options_from_proto(open, source, warnings);
  }
  SessionOptions must_read(const v1::OpenSession& open) {
    auto options = read(open);
    if (!options) throw std::runtime_error(to_string(options.error()));
    return *options;
  }
  // Reads for an empty session: reading needs only the session's terms.
  static std::unique_ptr<Session> session_with(const SessionOptions& options) {
    SessionOptions terms;
    terms.convention = options.convention;
    terms.settings = options.settings, terms.limits = options.limits;
    auto session = Session::open(std::move(terms), nullptr, nullptr);
    if (!session) throw std::runtime_error(to_string(session.error()));
    return std::move(*session);
  }
  Result<TickInput> read(const v1::Tick& tick, const SessionOptions& options = {}) {
    return tick_from_proto(tick, *session_with(options), source);
  }
  TickInput must_read(const v1::Tick& tick, const SessionOptions& options = {}) {
    auto input = read(tick, options);
    if (!input) throw std::runtime_error(to_string(input.error()));
    return *input;
  }

  const TemporaryFolder folder;
  GeometryStore store;
  SceneLibrary library{folder.path(), GltfLimits{}, store};
  SceneSource source{library, store};
  std::vector<std::string> warnings;
};

}  // namespace sightline::test
