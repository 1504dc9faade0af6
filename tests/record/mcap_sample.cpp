// Makes files for the format's own reader to judge, and reads files that the format's own writer made:
//   mcap_sample small|unfinished FILE    the small file of the unit tests; its messages on the standard output
//   mcap_sample session FOLDER           10 s of a made-up session, through the recorder
//   mcap_sample read FILE [FROM TO]      its messages on the standard output, then what was lost
//   mcap_sample recover FILE COPY
// A message is a line: topic, sequence, log time, publish time, bytes in hexadecimal.
#include <cmath>
#include <cstdio>
#include <string>

#include "server/record/mcap_recover.h"
#include "server/record/recorder.h"
#include "tests/record/small_file.h"

namespace sightline {
namespace {

void print(const test::PlainMessage& m) {
  std::printf("%s %u %llu %llu ", m.topic.c_str(), m.sequence, static_cast<unsigned long long>(m.log_time_ns),
              static_cast<unsigned long long>(m.publish_time_ns));
  for (const char c : m.data) std::printf("%02x", static_cast<unsigned char>(c));
  std::printf("\n");
}

int complain(const Error& error) {
  std::printf("error: %s\n", to_string(error).c_str());
  return 1;
}

int write_small(const std::string& path, bool finish) {
  const test::SmallFile file = test::make_small_file({.chunk_time = std::chrono::milliseconds(500)}, finish);
  const auto sink = create_file_sink(path);
  if (!sink) return complain(sink.error());
  if (const Status ok = (*sink)->write(file.bytes); !ok) return complain(ok.error());
  for (const test::PlainMessage& m : file.messages) print(m);
  return 0;
}

int read(const std::string& path, McapQuery query) {
  const auto source = open_file_source(path);
  if (!source) return complain(source.error());
  const Result<McapReader> reader = McapReader::open(**source, {});
  if (!reader) return complain(reader.error());
  McapReadReport report;
  for (const test::PlainMessage& m : test::read_all(*reader, query, &report)) print(m);
  std::printf("chunks read: %llu\n", static_cast<unsigned long long>(report.chunks_read));
  for (const McapLoss* loss : {&reader->info().loss, static_cast<const McapLoss*>(&report.loss)})
    for (const McapTrouble& trouble : loss->first_troubles)
      std::printf("trouble: %s\n", to_string(trouble.error).c_str());
  return 0;
}

int recover(const std::string& path, const std::string& copy) {
  const auto source = open_file_source(path);
  if (!source) return complain(source.error());
  const auto sink = create_file_sink(copy);
  if (!sink) return complain(sink.error());
  const Result<McapRecovery> done = recover_mcap(**source, **sink, {}, {});
  if (!done) return complain(done.error());
  std::printf("messages: %llu\n", static_cast<unsigned long long>(done->messages));
  return 0;
}

v1::OpenSession some_open() {
  v1::OpenSession open;
  open.mutable_convention()->set_preset(v1::Convention::PRESET_UNREAL);
  open.set_seed(7);
  v1::NewInstance& box = *open.add_instances();
  box.set_id(5);
  box.mutable_pose()->mutable_position()->set_x(100);
  box.mutable_pose()->mutable_position()->set_y(200);
  box.mutable_pose()->mutable_position()->set_z(300);
  box.mutable_shape()->mutable_box()->mutable_half_extent()->set_x(10);
  box.mutable_shape()->mutable_box()->mutable_half_extent()->set_y(20);
  box.mutable_shape()->mutable_box()->mutable_half_extent()->set_z(30);
  v1::NewInstance& target = *open.add_instances();
  target.set_id(9);
  target.mutable_shape()->mutable_capsule()->set_radius(30);
  target.mutable_shape()->mutable_capsule()->set_half_height(60);
  open.add_targets()->set_id(9);
  return open;
}

v1::Tick some_tick(uint64_t i) {
  v1::Tick tick;
  tick.set_sequence(i);
  tick.set_time_s(static_cast<double>(i) / 60);
  tick.mutable_transforms()->add_ids(9);
  for (const double p :
       {std::cos(0.01 * static_cast<double>(i)) * 500, std::sin(0.01 * static_cast<double>(i)) * 500, 90.0})
    tick.mutable_transforms()->add_positions(p);
  return tick;
}

v1::CameraReply some_reply(uint64_t i) {
  v1::CameraReply reply;
  reply.set_sequence(i);
  reply.set_time_s(static_cast<double>(i) / 60);
  reply.mutable_pose()->mutable_position()->set_x(static_cast<double>(i));
  reply.mutable_pose()->mutable_position()->set_z(200);
  reply.mutable_pose()->mutable_rotation()->set_w(1);
  reply.set_field_of_view(90);
  reply.set_status(i < 300 ? v1::TRACKING_STATUS_TRACKING : v1::TRACKING_STATUS_PARTIAL_VIEW);
  v1::TargetVisibility& target = *reply.add_targets();
  target.set_id(9);
  target.set_state(i < 300 ? v1::TARGET_STATE_VISIBLE : v1::TARGET_STATE_PARTIAL);
  target.set_filtered_share(i < 300 ? 1.0 : 0.5);
  return reply;
}

int record_session(const std::string& folder) {
  uint64_t now_ns = 1'700'000'000ull * test::kSecondNs;
  RecordSettings settings;
  settings.folder = folder;
  settings.limits.free_reserve_bytes = 0;
  const auto files = system_files();
  RecordWriter writer(
      settings, *files, [&] { return now_ns; },
      [](const RecordWarning& warning) { std::printf("warning: %s\n", warning.text.c_str()); });
  v1::RecordingInfo info;
  info.set_session_id("sample");
  info.set_seed(7);
  auto recorder = writer.open_session(info);
  recorder->record(RecordTopic::kOpen, {now_ns, now_ns}, some_open());
  recorder->attach("scene.glb", "model/gltf-binary", now_ns, std::make_shared<const std::string>(5000, 'g'));
  for (uint64_t i = 1; i <= 600; ++i) {
    now_ns += test::kSecondNs / 60;
    recorder->record(RecordTopic::kTick, {now_ns, now_ns}, some_tick(i));
    recorder->record(RecordTopic::kReply, {now_ns + 1'000'000, now_ns + 1'000'000}, some_reply(i));
    writer.run_once();
  }
  return 0;
}

int run(const std::vector<std::string>& words) {
  if (words.size() == 2 && words[0] == "small") return write_small(words[1], true);
  if (words.size() == 2 && words[0] == "unfinished") return write_small(words[1], false);
  if (words.size() == 2 && words[0] == "session") return record_session(words[1]);
  if (words.size() == 2 && words[0] == "read") return read(words[1], {});
  if (words.size() == 4 && words[0] == "read")
    return read(words[1], {std::stoull(words[2]), std::stoull(words[3]), {}});
  if (words.size() == 3 && words[0] == "recover") return recover(words[1], words[2]);
  std::fprintf(stderr, "usage: mcap_sample small|unfinished|session|read|recover PATH ...\n");
  return 2;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  return sightline::run(std::vector<std::string>(argv + 1, argv + argc));
}
