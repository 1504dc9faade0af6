// Measures the cost of a recording for the recorded session, for the disk, and for its reader:
//
//   record_bench [FOLDER]     an hour at 60 Hz goes into new files there (default: the system's temporary folder)
//
// Every tick moves 10 instances with rotations and velocities; every reply has three targets.
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <vector>

#include "server/record/mcap_reader.h"
#include "server/record/recorder.h"

namespace sightline {
namespace {

constexpr uint64_t kSecondNs = 1'000'000'000;
constexpr uint64_t kHourTicks = 60 * 60 * 60;

double thread_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double wall_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<long>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

// Every instance moves on its own circle, so that no two ticks have the same bytes.
void fill(v1::Tick& tick, uint64_t i) {
  tick.Clear();
  tick.set_sequence(i);
  tick.set_time_s(static_cast<double>(i) / 60);
  v1::Transforms& moved = *tick.mutable_transforms();
  for (int n = 0; n < 10; ++n) {
    const double angle = 0.01 * static_cast<double>(i) * (1 + 0.1 * n), radius = 3 + n;
    moved.add_ids(static_cast<uint64_t>(n) + 1);
    for (const double p : {radius * std::cos(angle), 0.9, radius * std::sin(angle)}) moved.add_positions(p);
    for (const double r : {0.0, std::sin(angle / 2), 0.0, std::cos(angle / 2)})
      moved.add_rotations(static_cast<float>(r));
    for (const double v : {-radius * std::sin(angle), 0.0, radius * std::cos(angle)})
      moved.add_velocities(static_cast<float>(v));
  }
}

void fill(v1::CameraReply& reply, uint64_t i) {
  const double t = static_cast<double>(i) / 60;
  reply.Clear();
  reply.set_sequence(i);
  reply.set_time_s(t);
  reply.set_pose_time_s(t + 0.02);
  for (v1::Pose3* pose : {reply.mutable_pose(), reply.mutable_relative_pose()->mutable_pose()}) {
    pose->mutable_position()->set_x(std::sin(t));
    pose->mutable_position()->set_y(2 + std::sin(3 * t));
    pose->mutable_position()->set_z(std::cos(t));
    pose->mutable_rotation()->set_y(std::sin(t / 2));
    pose->mutable_rotation()->set_w(std::cos(t / 2));
  }
  reply.mutable_velocity()->set_x(std::cos(t));
  reply.mutable_angular_velocity()->set_y(0.5 + 0.01 * std::sin(t));
  reply.set_field_of_view(0.7);
  for (uint64_t n = 1; n <= 3; ++n) {
    v1::TargetVisibility& target = *reply.add_targets();
    target.set_id(n);
    target.set_state(v1::TARGET_STATE_PARTIAL);
    target.set_visible_share(0.5 + 0.5 * std::sin(t + static_cast<double>(n)));
    target.set_filtered_share(0.5 + 0.5 * std::sin(t - 0.05 + static_cast<double>(n)));
    target.set_distance(4 + std::sin(t));
    target.set_in_picture(true);
    v1::Occluder& occluder = *target.add_occluders();
    occluder.set_id(77 + n);
    occluder.set_share(0.25);
  }
  reply.mutable_candidate_counts()->set_total(512);
  reply.mutable_candidate_counts()->set_all_visible(static_cast<uint32_t>(200 + 100 * std::sin(t)));
  for (int n = 0; n < 3; ++n) reply.mutable_candidate_counts()->add_target_visible_counts(300);
  reply.set_status(v1::TRACKING_STATUS_TRACKING);
  reply.set_reason(v1::MOVE_REASON_BEST_ALL_VISIBLE);
  reply.set_reason_text("going to the position with the best view of all targets, now and soon");
  reply.set_mirror_revision(1);
  reply.set_mirror_hash(0x9E3779B97F4A7C15ull * i);
  reply.mutable_stage_times()->set_sample_us(300.f + static_cast<float>(i % 97));
  reply.mutable_stage_times()->set_total_us(700.f + static_cast<float>(i % 89));
}

struct Hour {
  double caller_ns = 0;  // thread CPU of one tick and its reply, the median of batches
  double writer_us = 0;  // thread CPU of the writer for them
  double bytes_per_tick = 0;
  uint64_t wire_bytes = 0;  // of a tick and its reply, as they are on the wire
  uint64_t dropped = 0;
  std::string path;
};

Hour record_hour(const std::string& folder, bool for_viewers, uint64_t ticks) {
  uint64_t now_ns = 1'700'000'000ull * kSecondNs;
  RecordSettings settings;
  settings.folder = folder;
  settings.limits = {
      .max_total_bytes = uint64_t{8} << 30, .max_file_bytes = uint64_t{4} << 30, .free_reserve_bytes = 0};
  settings.for_viewers = for_viewers;
  const auto files = system_files();
  Hour hour;
  {
    RecordWriter writer(
        settings, *files, [&] { return now_ns; },
        [](const RecordWarning& warning) { std::printf("warning: %s\n", warning.text.c_str()); });
    v1::RecordingInfo info;
    info.set_session_id(for_viewers ? "with" : "without");
    auto recorder = writer.open_session(info);
    v1::OpenSession open;
    open.mutable_lens()->set_aspect(1.6);
    recorder->record(RecordTopic::kOpen, {now_ns, now_ns}, open);

    constexpr uint64_t kBatch = 60;
    std::vector<v1::Tick> made_ticks(kBatch);
    std::vector<v1::CameraReply> made_replies(kBatch);
    std::vector<double> batches_ns;
    double writer_s = 0;
    for (uint64_t i = 0; i < ticks; i += kBatch) {
      for (uint64_t k = 0; k < kBatch; ++k) fill(made_ticks[k], i + k + 1), fill(made_replies[k], i + k + 1);
      const double before = thread_s();
      for (uint64_t k = 0; k < kBatch; ++k) {
        now_ns += kSecondNs / 60;
        recorder->record(RecordTopic::kTick, {now_ns, now_ns}, made_ticks[k]);
        recorder->record(RecordTopic::kReply, {now_ns + 1'000'000, now_ns + 1'000'000}, made_replies[k]);
      }
      const double between = thread_s();
      batches_ns.push_back(1e9 * (between - before) / kBatch);
      writer.run_once();
      writer_s += thread_s() - between;
    }
    hour.caller_ns = median(batches_ns);
    hour.writer_us = 1e6 * writer_s / static_cast<double>(ticks);
    hour.dropped = recorder->dropped();
    hour.wire_bytes = made_ticks[0].ByteSizeLong() + made_replies[0].ByteSizeLong();
    hour.path = folder + "/" + recording_name(now_ns - ticks * (kSecondNs / 60), info.session_id(), 1);
  }
  hour.bytes_per_tick = static_cast<double>(std::filesystem::file_size(hour.path)) / static_cast<double>(ticks);
  return hour;
}

void open_and_seek(const std::string& path) {
  std::vector<double> info_ms, seek_ms;
  uint64_t chunks = 0, of_chunks = 0;
  for (int i = 0; i < 9; ++i) {
    const double start = wall_s();
    const auto source = open_file_source(path);
    if (!source) return;
    const Result<McapReader> reader = McapReader::open(**source, {});
    if (!reader) return;
    const double opened = wall_s();
    const mcap::Statistics& all = reader->info().statistics;
    const McapQuery query{.start_ns = all.start_time_ns / 2 + all.end_time_ns / 2, .topics = {"/sightline/reply"}};
    v1::CameraReply reply;
    const McapReadReport report = reader->read(query, [&](const McapMessage& m) {
      return !reply.ParseFromArray(m.message.data.data(), static_cast<int>(m.message.data.size()));
    });
    chunks = report.chunks_read;
    of_chunks = reader->info().chunks.size();
    info_ms.push_back(1e3 * (opened - start));
    seek_ms.push_back(1e3 * (wall_s() - opened));
  }
  std::printf("info of an hour        %8.2f ms\nseek to the middle     %8.2f ms, %llu of %llu chunks read\n",
              median(info_ms), median(seek_ms), static_cast<unsigned long long>(chunks),
              static_cast<unsigned long long>(of_chunks));
}

// Measures what the writer spends to keep the head of the next part ready, and to begin a part, in a session with many
// movers.
void measure_fold() {
  constexpr uint64_t kTicks = 60 * 600;
  constexpr int kMovers = 10'000;
  SessionSnapshot snapshot;
  v1::OpenSession open;
  for (uint64_t n = 1; n <= kMovers; ++n) open.add_instances()->set_id(n);
  snapshot.take_open(open);
  v1::Tick tick;
  v1::CameraReply reply;
  std::vector<double> batches_us;
  constexpr uint64_t kBatch = 60;
  std::vector<v1::Tick> ticks(kBatch);
  std::vector<v1::CameraReply> replies(kBatch);
  for (uint64_t i = 0; i < kTicks; i += kBatch) {
    for (uint64_t k = 0; k < kBatch; ++k) fill(ticks[k], i + k + 1), fill(replies[k], i + k + 1);
    const double start = thread_s();
    for (uint64_t k = 0; k < kBatch; ++k) {
      snapshot.take_tick(std::move(ticks[k]), {});
      snapshot.take_reply(replies[k]);
    }
    batches_us.push_back(1e6 * (thread_s() - start) / kBatch);
  }
  fill(tick, kTicks + 1);
  tick.clear_transforms();
  for (uint64_t n = 1; n <= kMovers; ++n) {
    tick.mutable_transforms()->add_ids(n);
    for (int k = 0; k < 3; ++k) tick.mutable_transforms()->add_positions(static_cast<double>(n));
  }
  snapshot.take_tick(tick, {});
  fill(reply, kTicks + 1);
  snapshot.take_reply(reply);
  std::vector<double> heads_ms;
  size_t bytes = 0;
  for (int i = 0; i < 9; ++i) {
    const double start = thread_s();
    bytes = snapshot.tick().SerializeAsString().size();
    heads_ms.push_back(1e3 * (thread_s() - start));
  }
  std::printf("snapshot\n  a tick and its reply          %8.2f us (thread CPU, median of seconds)\n",
              median(batches_us));
  std::printf("  head of a part, %d movers %8.2f ms, %zu bytes\n", kMovers, median(heads_ms), bytes);
}

void report(const char* name, const Hour& hour) {
  std::printf("%s\n  caller, a tick and its reply  %8.0f ns (thread CPU, median of seconds)\n", name, hour.caller_ns);
  std::printf("  writer, for them              %8.1f us (thread CPU, mean)\n", hour.writer_us);
  std::printf("  on the wire / on the disk     %8llu / %.0f bytes; %.1f MB an hour; dropped %llu\n",
              static_cast<unsigned long long>(hour.wire_bytes), hour.bytes_per_tick,
              1e-6 * hour.bytes_per_tick * static_cast<double>(kHourTicks),
              static_cast<unsigned long long>(hour.dropped));
}

int run(const std::filesystem::path& parent) {
  const std::filesystem::path folder = parent / ("record_bench-" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  report("wire messages alone", record_hour(folder.string(), false, kHourTicks));
  const Hour hour = record_hour(folder.string(), true, kHourTicks);
  report("with what viewers understand", hour);
  measure_fold();
  open_and_seek(hour.path);
  std::filesystem::remove_all(folder);
  return 0;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  return sightline::run(argc > 1 ? std::filesystem::path(argv[1]) : std::filesystem::temp_directory_path());
}
