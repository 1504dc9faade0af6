// The clients of a soak: soak_client ADDRESS SECONDS [SESSIONS [LIFE_S]]. Every session ticks at 60 Hz and changes its
// scene twice a second. After about LIFE_S (30) it ends and another one follows: some are closed in order, some are cut
// off, some are cut off and resumed, and some open a scene that they have uploaded. Every ten seconds the program
// prints a line of JSON: the counts since the last line, the round trips in milliseconds, and errors that the clients
// did not cause. A session that the daemon drains is closed, and the program then ends.
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "sightline/v1/camera_control.grpc.pb.h"
#include "tests/support/glb_builder.h"

namespace {

using namespace sightline;
using Clock = std::chrono::steady_clock;
constexpr std::chrono::microseconds kInterval{16'667};
constexpr uint64_t kTarget = 1, kFirstBox = 10;
constexpr size_t kMostBoxes = 20;

// The counts of all sessions. Each printed line sets them to zero.
class Figures {
 public:
  void answered(double round_trip_ms, uint64_t merged) {
    const std::lock_guard lock(mutex_);
    round_trips_ms_.push_back(round_trip_ms);
    answered_ += 1, merged_ += merged;
  }
  // What a daemon that stops refuses is no error. It may refuse something before it tells the sessions that it stops.
  void error(const std::string& what) {
    for (int i = 0; i < 100 && !drained; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(50));
    const std::lock_guard lock(mutex_);
    if (!drained) errors_.push_back(what);
  }
  std::atomic<uint64_t> sent{0}, opened{0}, cut{0}, resumed{0}, uploads{0};
  // The daemon has asked a session to end.
  std::atomic<bool> drained{false};

  void print(double at_s) {
    const std::lock_guard lock(mutex_);
    std::sort(round_trips_ms_.begin(), round_trips_ms_.end());
    const auto share = [&](double part) {
      return round_trips_ms_.empty()
                 ? 0.0
                 : round_trips_ms_[std::min(round_trips_ms_.size() - 1,
                                            static_cast<size_t>(part * static_cast<double>(round_trips_ms_.size())))];
    };
    std::printf(
        "{\"at_s\": %.1f, \"sent\": %llu, \"answered\": %llu, \"merged\": %llu, \"opened\": %llu, \"cut\": %llu, "
        "\"resumed\": %llu, \"uploads\": %llu, "
        "\"p50_ms\": %.3f, \"p99_ms\": %.3f, \"max_ms\": %.3f, \"errors\": [",
        at_s, count(sent), static_cast<unsigned long long>(answered_), static_cast<unsigned long long>(merged_),
        count(opened), count(cut), count(resumed), count(uploads), share(0.5), share(0.99), share(1.0));
    for (size_t i = 0; i < std::min<size_t>(errors_.size(), 20); ++i)
      std::printf("%s\"%s\"", i ? ", " : "", errors_[i].c_str());
    std::puts("]}");
    std::fflush(stdout);
    round_trips_ms_.clear(), errors_.clear();
    answered_ = merged_ = 0;
  }

 private:
  static unsigned long long count(std::atomic<uint64_t>& figure) { return figure.exchange(0); }

  std::mutex mutex_;
  std::vector<double> round_trips_ms_;
  std::vector<std::string> errors_;
  uint64_t answered_ = 0, merged_ = 0;
};

std::string plain(std::string text) {
  std::erase_if(
      text, [](char letter) { return letter == '"' || letter == '\\' || static_cast<unsigned char>(letter) < ' '; });
  return text;
}

enum class End { kInOrder, kCutOff, kResumed };

// One session, from its opening to its end. It is a Control call, or two when it is resumed.
class Life {
 public:
  Life(v1::CameraControlService::Stub& stub, Figures& figures, unsigned seed)
      : stub_(stub), figures_(figures), random_(seed) {}

  void run(Clock::duration length, End end, const std::string& scene) {
    v1::ControlRequest request;
    *request.mutable_open() = opening(scene);
    request.mutable_open()->set_resumable(end == End::kResumed);
    v1::SessionOpened opened;
    if (!begin(request, opened)) return;
    ++figures_.opened;
    play_and_end(end == End::kResumed ? length / 2 : length, end != End::kInOrder);
    if (end != End::kResumed || figures_.drained) return;
    request.mutable_resume()->set_token(opened.resume_token());
    request.mutable_resume()->set_answered_sequence(answered_);
    if (!begin(request, opened)) return;
    ++figures_.resumed;
    send_again_after(opened.newest_sequence());
    play_and_end(length / 2, false);
  }

 private:
  void fail(const std::string& what) { figures_.error(plain(what)); }

  bool begin(const v1::ControlRequest& request, v1::SessionOpened& opened) {
    call_.reset();  // it refers to its context
    context_ = std::make_unique<grpc::ClientContext>();
    call_ = stub_.Control(context_.get());
    call_->Write(request);
    v1::ControlResponse reply;
    if (!call_->Read(&reply) || !reply.has_opened()) {
      fail("an opening failed: " + call_->Finish().error_message());
      return false;
    }
    opened = reply.opened();
    return true;
  }

  void play_and_end(Clock::duration length, bool cut_off) {
    std::thread reader([this] { read(); });
    play(length);
    if (cut_off)
      ++figures_.cut, context_->TryCancel();
    else
      call_->WritesDone();
    reader.join();
    const grpc::Status status = call_->Finish();
    if (!cut_off && !status.ok()) fail("a session ended with " + status.error_message());
  }

  void send_again_after(uint64_t newest) {
    const std::lock_guard lock(mutex_);
    for (const Sent& sent : unanswered_)
      if (sent.tick.sequence() > newest) write(sent.tick);
  }
  bool write(const v1::Tick& tick) {
    v1::ControlRequest request;
    *request.mutable_tick() = tick;
    return call_->Write(request);
  }
  double offset() { return std::uniform_real_distribution(-6.0, 6.0)(random_); }

  v1::OpenSession opening(const std::string& scene) {
    v1::OpenSession open;
    open.mutable_camera()->mutable_position()->set_y(2);
    open.mutable_camera()->mutable_position()->set_z(8);
    open.add_targets()->set_id(kTarget);
    v1::NewInstance& target = *open.add_instances();
    target.set_id(kTarget);
    target.mutable_shape()->mutable_capsule()->set_radius(0.3);
    target.mutable_shape()->mutable_capsule()->set_half_height(0.6);
    if (!scene.empty()) open.mutable_scene()->set_hash(scene);
    return open;
  }

  void play(Clock::duration length) {
    const Clock::time_point start = Clock::now();
    for (int64_t n = 1; Clock::now() < start + length && !figures_.drained; ++n) {
      const Clock::time_point due = start + n * kInterval;
      std::this_thread::sleep_until(due);
      v1::Tick tick;
      tick.set_sequence(++sequence_);
      tick.set_time_s(static_cast<double>(sequence_) / 60);
      tick.mutable_transforms()->add_ids(kTarget);
      for (const double p : {2 * std::sin(tick.time_s()), 0.9, 2 * std::cos(tick.time_s())})
        tick.mutable_transforms()->add_positions(p);
      if (sequence_ % 30 == 0) change_scene(*tick.mutable_delta());
      {
        const std::lock_guard lock(mutex_);
        unanswered_.push_back({due, tick});
      }
      ++figures_.sent;
      if (!write(tick)) return;
    }
  }

  void change_scene(v1::SceneDelta& delta) {
    if (boxes_.size() >= kMostBoxes) {
      delta.add_removed_ids(boxes_.front());
      boxes_.pop_front();
    }
    v1::NewInstance& box = *delta.add_added_instances();
    box.set_id(kFirstBox + next_box_++);
    boxes_.push_back(box.id());
    v1::Vec3& half = *box.mutable_shape()->mutable_box()->mutable_half_extent();
    half.set_x(0.2 + 0.01 * static_cast<double>(next_box_ % 30)), half.set_y(1), half.set_z(0.2);
    v1::Vec3& place = *box.mutable_pose()->mutable_position();
    place.set_x(offset()), place.set_y(1), place.set_z(offset());
  }

  void read() {
    v1::ControlResponse reply;
    while (call_->Read(&reply)) {
      if (reply.has_tick_error()) fail("a tick was refused: " + reply.tick_error().message());
      if (reply.has_drain()) figures_.drained = true;
      if (!reply.has_camera()) continue;
      const std::lock_guard lock(mutex_);
      answered_ = reply.camera().sequence();
      Clock::time_point due{};
      while (!unanswered_.empty() && unanswered_.front().tick.sequence() <= answered_)
        due = unanswered_.front().due, unanswered_.pop_front();
      figures_.answered(std::chrono::duration<double, std::milli>(Clock::now() - due).count(),
                        reply.camera().merged_ticks());
    }
  }

  v1::CameraControlService::Stub& stub_;
  Figures& figures_;
  std::mt19937 random_;
  std::unique_ptr<grpc::ClientContext> context_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::ControlRequest, v1::ControlResponse>> call_;
  std::deque<uint64_t> boxes_;
  uint64_t next_box_ = 0;
  uint64_t sequence_ = 0;
  struct Sent {
    Clock::time_point due;
    v1::Tick tick;
  };
  std::mutex mutex_;
  std::deque<Sent> unanswered_;  // guarded by mutex_
  uint64_t answered_ = 0;        // guarded by mutex_ while a reader runs
};

// A scene file that no other session has, and its hash on the server.
std::string upload(v1::CameraControlService::Stub& stub, Figures& figures, unsigned number) {
  GlbBuilder file;
  file.triangle_node();
  file.json["asset"]["generator"] = std::to_string(number);
  const std::vector<std::byte> bytes = file.glb();
  grpc::ClientContext context;
  v1::UploadSceneResponse answer;
  const auto call = stub.UploadScene(&context, &answer);
  v1::UploadSceneRequest request;
  request.set_chunk(bytes.data(), bytes.size());
  call->Write(request);
  call->WritesDone();
  if (const grpc::Status status = call->Finish(); !status.ok())
    return figures.error(plain("an upload failed: " + status.error_message())), "";
  ++figures.uploads;
  return answer.hash();
}

void live(const std::string& address, unsigned number, Clock::time_point end, double life_s, Figures& figures) {
  std::mt19937 random(number);
  constexpr End kEnds[] = {End::kInOrder, End::kCutOff, End::kInOrder, End::kResumed};
  for (unsigned round = 0; Clock::now() < end && !figures.drained; ++round) {
    // A connection of its own, as another process would have.
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    const auto channel = grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
    // The first try to connect may fail for no reason (see connect() in tests/service/service_world.cpp).
    channel->WaitForConnected(std::chrono::system_clock::now() + std::chrono::seconds(20));
    const auto stub = v1::CameraControlService::NewStub(channel);
    const std::string scene = round % 3 == 1 ? upload(*stub, figures, 1000 * number + round) : "";
    const std::chrono::duration<double> life(std::uniform_real_distribution(life_s * 2 / 3, life_s * 4 / 3)(random));
    const auto length = std::min(std::chrono::duration_cast<Clock::duration>(life), end - Clock::now());
    Life(*stub, figures, number * 7919 + round).run(length, kEnds[(number + round) % std::size(kEnds)], scene);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3 || argc > 5) return std::fputs("usage: soak_client ADDRESS SECONDS [SESSIONS [LIFE_S]]\n", stderr), 2;
  const Clock::time_point start = Clock::now();
  const Clock::time_point end = start + std::chrono::seconds(std::atoi(argv[2]));
  const unsigned sessions = argc > 3 ? static_cast<unsigned>(std::atoi(argv[3])) : 16;
  const double life_s = argc > 4 ? std::atof(argv[4]) : 30;
  Figures figures;
  std::vector<std::thread> clients;
  for (unsigned n = 0; n < sessions; ++n) clients.emplace_back([&, n] { live(argv[1], n, end, life_s, figures); });
  for (Clock::time_point due = start + std::chrono::seconds(10); due <= end && !figures.drained;
       due += std::chrono::seconds(10)) {
    std::this_thread::sleep_until(due);
    figures.print(std::chrono::duration<double>(due - start).count());
  }
  for (std::thread& client : clients) client.join();
  return 0;
}
