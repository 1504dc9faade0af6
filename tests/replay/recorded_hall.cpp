#include "tests/replay/recorded_hall.h"

#include <gtest/gtest.h>

#include "client/scenario/scenario.h"
#include "client/scenario/scenario_session.h"
#include "scenes/hall.h"
#include "tests/recordings/string_sink.h"

namespace sightline::test {

RecordedHall record_hall(SamplerDevice& sampler, const RecordedHallOptions& options) {
  const double duration_s = options.ticks / 60.0 + 1.0;
  const auto glb = options.scene ? options.scene(duration_s) : scenes::make_hall({.seed = 1, .duration_s = duration_s});
  LocalWorld world("", sampler);
  const auto asset = world.scenes.add_uploaded(glb);
  EXPECT_TRUE(asset.has_value());
  const auto scenario = Scenario::from_asset(*asset);
  EXPECT_TRUE(scenario.has_value());
  const std::string scene_hash = to_hex((*asset)->hash);
  v1::OpenSession open = open_request(*scenario, scene_hash, options.seed);
  *open.mutable_settings() = options.settings;
  *open.mutable_tuning() = options.tuning;
  if (options.change_open) options.change_open(open);
  auto session = LocalSession::open(open, world);
  EXPECT_TRUE(session.has_value());

  RecordedHall recorded;
  v1::RecordingInfo info;
  info.set_sampler(sampler.kind());
  info.set_session_id("recorded-hall");
  info.set_part(1);
  info.set_start_time_ns(kRecordedStartNs);
  RecordingWriter writer(std::make_unique<StringSink>(recorded.bytes), info);
  const auto put = [&](const auto& message, uint64_t log_ns) {
    EXPECT_TRUE(writer.write(message, log_ns).has_value());
  };
  uint64_t log_ns = kRecordedStartNs;
  v1::CameraReply reply;
  put(open, log_ns);
  put((*session)->opened(), log_ns);
  if (options.attach_scene) {
    const std::string bytes(reinterpret_cast<const char*>(glb.data()), glb.size());
    EXPECT_TRUE(writer.attach({"upload/" + scene_hash, bytes}, log_ns).has_value());
  }
  for (int i = 0; i < options.ticks; ++i) {
    log_ns += 16'666'667;
    v1::Tick tick = tick_at(*scenario, static_cast<uint64_t>(i) + 1, i / 60.0, 1.0 / 60.0);
    if (options.change) options.change(i, reply, tick);
    v1::TickError rejection;
    put(tick, log_ns);
    if (!(*session)->apply(tick, rejection)) {
      EXPECT_TRUE(options.change) << rejection.message();
      put(rejection, log_ns);
      continue;
    }
    if (options.merge_every > 0 && i % options.merge_every == 0) continue;
    EXPECT_TRUE((*session)->step(options.quality_level, reply).has_value());
    put(reply, log_ns + 1'000'000);
    recorded.hash = reply_hash(reply, recorded.hash);
    ++recorded.replies;
    if (options.memory_every > 0 && recorded.replies % static_cast<size_t>(options.memory_every) == 0) {
      v1::StepMemory memory;
      (*session)->write_memory(memory);
      put(memory, log_ns + 2'000'000);
    }
  }
  EXPECT_TRUE(writer.finish().has_value());
  return recorded;
}

}  // namespace sightline::test
