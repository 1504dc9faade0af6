// Runs the commands on recordings, and writes a session to a file message by message.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "client/recordings/commands.h"
#include "client/recordings/recording.h"
#include "client/recordings/writer.h"
#include "server/sample/embree_sampler.h"
#include "tests/record/small_file.h"
#include "tests/recordings/string_sink.h"
#include "tests/replay/recorded_hall.h"
#include "tests/support/temporary_folder.h"

namespace sightline::test {

struct Said {
  int status = -1;
  std::string out, err;
};

class Verbs : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::string put(const std::string& name, const std::string& bytes) const {
    std::ofstream(path(name), std::ios::binary) << bytes;
    return path(name);
  }
  static std::string bytes_of(const std::string& file) {
    std::ostringstream all;
    all << std::ifstream(file, std::ios::binary).rdbuf();
    return all.str();
  }
  // Made once for all tests; half a minute at 60 Hz would be as good.
  static const std::string& hall() {
    static const std::string bytes = [] {
      const auto sampler = make_embree_sampler_device();
      return record_hall(*sampler, {.ticks = 90, .merge_every = 3, .memory_every = 4}).bytes;
    }();
    return bytes;
  }

  template <typename Options, typename Run>
  static Said said(const Options& options, Run run) {
    std::ostringstream out, err;
    Said done;
    done.status = run(options, out, err);
    done.out = out.str();
    done.err = err.str();
    return done;
  }
  static Said info(std::vector<std::string> files, bool as_json = false) {
    return said(InfoOptions{.files = std::move(files), .json = as_json}, run_info_command);
  }
  static Said verify(const std::string& file, bool as_json = false) {
    return said(VerifyOptions{.files = {file}, .json = as_json}, run_verify_command);
  }
  static Said recover(const std::string& file, const std::string& out) {
    return said(RecoverOptions{.file = file, .out = out}, run_recover_command);
  }
  static Said dump(const DumpOptions& options) { return said(options, run_dump_command); }
  static Said cut(const std::string& file, const std::string& out, double start_s,
                  double end_s = std::numeric_limits<double>::infinity()) {
    return said(CutOptions{.file = file, .out = out, .start_s = start_s, .end_s = end_s}, run_cut_command);
  }

  static std::vector<PlainMessage> messages_of(const std::string& bytes, const McapQuery& query = {}) {
    const MemorySource source(bytes);
    return read_all(McapReader::open(source, {}).value(), query);
  }
  static Recording recording_of(const std::string& bytes) {
    return Recording::open(std::make_shared<MemorySource>(bytes), "memory").value();
  }
  static std::vector<nlohmann::json> lines_of(const std::string& text) {
    std::vector<nlohmann::json> lines;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) lines.push_back(nlohmann::json::parse(line));
    return lines;
  }

  const TemporaryFolder folder_;
};

// A recording that is written message by message.
struct Told {
  explicit Told(v1::RecordingInfo info = {}) {
    if (info.part() == 0) info.set_part(1);
    info.set_start_time_ns(kRecordedStartNs);
    writer.emplace(std::make_unique<StringSink>(bytes), info);
    put(v1::OpenSession());
    put(v1::SessionOpened());
  }
  template <typename Message>
  void put(const Message& message) {
    log_ns += 5'000'000;
    EXPECT_TRUE(writer->write(message, log_ns).has_value());
  }
  void tick(uint64_t sequence) {
    v1::Tick tick;
    tick.set_sequence(sequence);
    put(tick);
  }
  void reply(uint64_t sequence, uint32_t merged = 0) {
    v1::CameraReply reply;
    reply.set_sequence(sequence);
    reply.set_merged_ticks(merged);
    put(reply);
  }
  void refuse(uint64_t sequence, const char* field = "tick.delta.removed_ids[0]") {
    v1::TickError rejection;
    rejection.set_sequence(sequence);
    if (*field) rejection.add_field_violations()->set_field(field);
    put(rejection);
  }
  std::string finish() {
    EXPECT_TRUE(writer->finish().has_value());
    return bytes;
  }

  std::string bytes;
  std::optional<RecordingWriter> writer;
  uint64_t log_ns = kRecordedStartNs;
};

}  // namespace sightline::test
