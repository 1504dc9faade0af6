#include "client/drive/page.h"

#include <algorithm>
#include <chrono>
#include <unordered_map>

#include "client/base/text_table.h"
#include "client/drive/report.h"
#include "client/recordings/writer.h"
#include "client/report/page.h"
#include "client/scenario/scenario_session.h"
#include "server/sample/embree_sampler.h"

namespace sightline {
namespace {

uint64_t ns(double seconds) {
  return static_cast<uint64_t>(std::max(0.0, seconds) * 1e9);
}

uint64_t start_of(const DrivenSession& driven) {
  const auto now = std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
  return static_cast<uint64_t>(now) - ns(driven.frames.back().received_s);
}

// Ticks stand before the reply that covers them, as in a daemon's recording. Ticks are made again from the scenario.
Status write_frames(const DrivenSession& driven, uint64_t start_ns, RecordingWriter& writer) {
  uint64_t sequence = 0;
  for (const PlayedFrame& frame : driven.frames) {
    const uint64_t received_ns = start_ns + ns(frame.received_s);
    const uint64_t sent_ns = received_ns - ns(frame.latency_ms * 1e-3);
    while (sequence < frame.reply.sequence()) {
      const v1::Tick tick = played_tick(driven.scenario, driven.play, sequence++);
      if (Status done = writer.write(tick, sent_ns); !done) return done;
    }
    if (Status done = writer.write(frame.reply, received_ns); !done) return done;
  }
  return writer.finish();
}

Result<std::string> record(const DrivenSession& driven, const std::string& title) {
  v1::RecordingInfo info;
  info.set_session_id(driven.opened.session_id());
  info.set_sampler(driven.opened.sampler());
  info.set_seed(driven.open.seed());
  info.set_label(title);
  info.set_part(1);
  info.set_start_time_ns(start_of(driven));
  auto memory = std::make_unique<MemorySink>();
  const MemorySink& sink = *memory;
  RecordingWriter writer(std::move(memory), info);
  const uint64_t start_ns = info.start_time_ns();
  const auto* file = reinterpret_cast<const char*>(driven.scene_file.data());
  Status done = writer.write(driven.open, start_ns);
  if (done) done = writer.write(driven.opened, start_ns);
  if (done) done = writer.attach({"upload/" + driven.open.scene().hash(), {file, driven.scene_file.size()}}, start_ns);
  if (done) done = write_frames(driven, start_ns, writer);
  if (!done) return tl::unexpected(done.error());
  return sink.bytes();
}

// The page shows the truth where the drive judged a picture, and nowhere else.
void add_truth(const DrivenSession& driven, SessionPage& page) {
  std::unordered_map<uint64_t, const FrameTruth*> truths;  // by sequence
  for (size_t i = 0; i < driven.frames.size(); ++i) truths[driven.frames[i].reply.sequence()] = &driven.truths[i];
  for (PageFrame& frame : page.frames) {
    const FrameTruth& truth = *truths.at(frame.sequence);
    frame.clearance_m = truth.body.clearance_m;
    for (size_t k = 0; k < page.targets.size(); ++k) {
      frame.sights[k].true_share = kPageUnknown;
      if (!truth.picture) continue;
      for (const TargetTruth& target : truth.picture->targets)
        if (target.id == page.targets[k].id) frame.sights[k].true_share = target.visible_share();
    }
  }
}

void add_figures(const DrivenSession& driven, SessionPage& page) {
  std::vector<FigureRow> rows = truth_rows(driven.run, driven.follow);
  for (FigureRow& row : latency_rows(driven.frames)) rows.push_back(std::move(row));
  for (FigureRow& row : page.figures) rows.push_back(std::move(row));
  page.columns = {"sightline"};
  if (driven.follow) page.columns.emplace_back("follow");
  for (FigureRow& row : rows) row.values.resize(page.columns.size());
  page.figures = std::move(rows);
}

}  // namespace

Result<SessionPage> drive_page(const DrivenSession& driven, const std::string& title,
                               const std::function<void(const char* what, size_t done, size_t of)>& progress) {
  const auto bytes = record(driven, title);
  if (!bytes) return tl::unexpected(bytes.error());
  const auto recording = Recording::open(std::make_shared<MemorySource>(*bytes), "");
  if (!recording) return tl::unexpected(recording.error());
  RecordingPageOptions options;
  options.cells = PageCells::kRecorded;
  options.max_frames = std::max<size_t>(2, driven.frames.size());
  options.progress = progress;
  const auto sampler = make_embree_sampler_device();
  auto page = recording_page(*recording, options, *sampler);
  if (!page) return page;
  add_truth(driven, *page);
  add_figures(driven, *page);
  page->facts.emplace_back("rate", formatted("%g Hz, ", driven.play.rate_hz) +
                                       (driven.play.lockstep ? "as fast as replies come" : "in real time"));
  return page;
}

}  // namespace sightline
