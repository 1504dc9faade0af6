// Sessions whose clients send legal and illegal extremes in every numeric field, with the real samplers: number_storm
// COUNT [SEED [SAMPLER [SESSION]]].
//
// It plays COUNT ticks. Ordinary ticks alternate with extreme ones, in which one to three numbers are set to other
// values (number_fields.h). Messages go the way that they go in the service: converted, applied, stepped, and answered.
// Every refusal must name a field. Every number of every reply must be finite, and the camera must keep its limits.
// SAMPLER is `embree` (the default) or `egl`. With SESSION, only that session of the run is played and each of its
// messages is printed: the last one printed is the one that failed.

#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>

#include "server/sample/embree_sampler.h"
#include "server/service/session_budget.h"
#include "server/wire/from_proto.h"
#include "server/wire/to_proto.h"
#include "tests/fuzz/number_fields.h"
#include "tests/fuzz/usual_messages.h"
#include "tests/sample/egl_device.h"

namespace sightline::test {
namespace {

constexpr uint64_t kTicksOfSession = 120;
constexpr uint64_t kMostRefusedInARow = 12;
constexpr double kMostStepCostMs = 3.0;

struct Counts {
  uint64_t sessions = 0, refused_openings = 0, ticks = 0, refused = 0, replies = 0, checked_limits = 0, wrong = 0;
  double longest_step_ms = 0.0;
  uint64_t longest_in = 0;  // session
};

// All sessions share these, as in a daemon.
struct Shared {
  explicit Shared(SamplerDevice& all) : device(all) {}
  SamplerDevice& device;
  GeometryStore store;
  SceneLibrary library{"", GltfLimits{}, store};
  ExtentCache extents;
  std::vector<std::shared_ptr<const Geometry>> kept;  // so that the tables of usual shapes are built once
  std::vector<NumberField> of_open = number_fields(*v1::OpenSession::descriptor()),
                           of_tick = number_fields(*v1::Tick::descriptor());
  bool prints = false;
};

// Exact for small angles.
double turned_rad(const glm::dquat& from, const glm::dquat& to) {
  const glm::dquat turn = to * glm::conjugate(from);
  return 2 * std::atan2(glm::length(glm::dvec3(turn.x, turn.y, turn.z)), std::abs(turn.w));
}

class Player {
 public:
  Player(Shared& shared, uint64_t seed, uint64_t session, Counts& counts)
      : shared_(shared),
        random_(seed, session, RandomPurpose::kTest),
        usual_(random_),
        session_number_(session),
        counts_(counts) {}

  void play(uint64_t most_ticks) {
    ++counts_.sessions;
    if (!open()) return;
    uint64_t refused = 0;
    for (uint64_t i = 0; i < most_ticks && refused < kMostRefusedInARow && !wrong_; ++i)
      refused = tick(i) ? 0 : refused + 1;
  }

 private:
  bool open() {
    v1::OpenSession request = usual_.open();
    if (random_.next_below(2) == 0) change(request, shared_.of_open);
    say("open", request);
    std::vector<std::string> warnings;
    auto options = session_options_from_proto(request, {shared_.library, shared_.store}, warnings);
    if (!options) return ++counts_.refused_openings, refused(options.error());
    if (Status ok = check_step_cost(options->settings, options->targets, kLimits, "open.settings"); !ok)
      return ++counts_.refused_openings, false;
    if (random_.next_below(4) != 0) options->extents = &shared_.extents;
    auto opened = Session::open(std::move(*options), shared_.device.make_sampler(), nullptr);
    if (!opened) return ++counts_.refused_openings, refused(opened.error());
    session_ = std::move(*opened);
    v1::SessionOpened reply;
    opened_to_proto(*session_, reply);
    must_be_finite(reply);
    return true;
  }

  // False: it was refused.
  bool tick(uint64_t number) {
    v1::Tick request = usual_.tick(session_->sequence(), time_s_);
    if (number % 2 == 1) change(request, shared_.of_tick);
    say("tick", request);
    ++counts_.ticks;
    auto input = tick_from_proto(request, *session_, {shared_.library, shared_.store});
    if (!input) return ++counts_.refused, refused(input.error());
    if (over_budget(*input)) return ++counts_.refused, false;
    if (const Status applied = session_->apply(*input); !applied) return ++counts_.refused, refused(applied.error());
    const double dt_s = input->dt_s ? *input->dt_s : ticked_ ? input->time_s - time_s_ : 0.0;
    ticked_ = true, time_s_ = input->time_s;
    pending_s_ += dt_s < kShortestStepS ? 0.0 : dt_s;
    moved_by_client_ |= input->observed_camera.has_value();
    if (!request.step_control().merge_into_next()) step(static_cast<int>(request.step_control().quality_level()));
    return true;
  }

  bool over_budget(const TickInput& input) const {
    const StepSettings& settings = input.settings ? *input.settings : session_->settings();
    return session_->mirror().size() + input.delta.add.size() > 100 ||
           !check_step_cost(settings, input.targets ? *input.targets : session_->targets(), kLimits, "tick");
  }

  void step(int quality_level) {
    const CameraState before = session_->carried().camera;
    const TurnState& turn = session_->carried().turn;
    const double turning_radps = std::hypot(turn.yaw_rate_radps, turn.pitch_rate_radps) +
                                 std::abs(turn.roll_rate_radps);
    const auto start = std::chrono::steady_clock::now();
    const auto answer = session_->step(quality_level);
    note_time(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    if (!answer) return wrong("the step failed: " + to_string(answer.error()));
    ++counts_.replies;
    camera_reply_to_proto(*answer, *session_, session_->diagnostics(), reply_);
    must_be_finite(reply_);
    for (const v1::TargetVisibility& target : reply_.targets())
      if (!(target.visible_share() >= 0 && target.visible_share() <= 1)) wrong("visible_share");
    const double dt_s = std::min(std::exchange(pending_s_, 0.0), kMaxStepS);
    const bool free = std::exchange(moved_by_client_, false) || reply_.cut();
    if (!free && stepped_) must_keep_limits(before, turning_radps, answer->step.camera, dt_s);
    stepped_ = true;
    if (counts_.replies % 16 == 0) must_be_resumable();
  }

  // For people: no test asserts times.
  void note_time(double step_ms) {
    if (step_ms <= counts_.longest_step_ms) return;
    counts_.longest_step_ms = step_ms, counts_.longest_in = session_number_;
  }

  // The state that a step leaves holds no number that is not finite: such a state could not be read back.
  void must_be_resumable() {
    std::string memory;
    session_->write_memory(memory);
    if (const Status ok = session_->resume(Session::memory_layout(), memory); !ok)
      wrong("the state cannot be resumed: " + to_string(ok.error()));
  }

  void must_keep_limits(const CameraState& before, double turning_radps, const CameraState& after, double dt_s) {
    ++counts_.checked_limits;
    const CameraLimits& limits = session_->limits();
    const double far = glm::length(before.pose.position_m), rounding_m = 1e-9 + 4e-15 * far;
    const double speed = glm::length(after.velocity_mps), former = glm::length(before.velocity_mps);
    const double change = limits.max_acceleration_mps2 * dt_s, slack = 1e-9 + 1e-6 * (limits.max_speed_mps + former);
    if (dt_s > 0 && speed > std::max(limits.max_speed_mps, former - change) + slack) wrong("speed");
    if (dt_s > 0 && glm::distance(after.velocity_mps, before.velocity_mps) > change + slack) wrong("acceleration");
    const double moved_m = glm::distance(after.pose.position_m, before.pose.position_m);
    if (moved_m > speed * dt_s + rounding_m) wrong("the camera moved farther than its speed allows");
    const double most_radps = std::max(limits.max_angular_speed_radps, turning_radps);
    if (turned_rad(before.pose.rotation, after.pose.rotation) > most_radps * dt_s * (1 + 1e-6) + 1e-14)
      wrong("angular speed");
  }

  void change(google::protobuf::Message& message, const std::vector<NumberField>& fields) {
    for (uint32_t left = 1 + random_.next_below(3); left > 0; --left) {
      const NumberField& field = fields[random_.next_below(static_cast<uint32_t>(fields.size()))];
      const std::string value = set_number(message, field, random_,
                                           [&](google::protobuf::Message& added) { usual_.fill(added); });
      if (shared_.prints) std::printf("%s = %s\n", field.path().c_str(), value.c_str());
    }
  }

  void must_be_finite(const google::protobuf::Message& message) {
    if (const std::string path = not_finite_in(message); !path.empty()) wrong("not finite: " + path);
  }

  // A refusal names a field and says why.
  bool refused(const Error& error) {
    if (shared_.prints) std::printf("refused: %s\n", to_string(error).c_str());
    if (error.field.empty() || error.message.empty()) wrong("a refusal without a field: " + to_string(error));
    return false;
  }

  void wrong(const std::string& what) {
    ++counts_.wrong, wrong_ = true;
    std::printf("session %llu, tick %llu: %s\n", static_cast<unsigned long long>(session_number_),
                static_cast<unsigned long long>(session_ ? session_->sequence() : 0), what.c_str());
  }

  void say(const char* kind, const google::protobuf::Message& message) const {
    if (!shared_.prints) return;
    std::printf("--- %s {%s}\n", kind, message.ShortDebugString().c_str());
    std::fflush(stdout);
  }

  static constexpr SessionLimits kLimits{.session_bytes = 0, .max_step_cost_ms = kMostStepCostMs};
  Shared& shared_;
  CounterRandom random_;
  UsualMessages usual_;
  const uint64_t session_number_;
  Counts& counts_;
  std::unique_ptr<Session> session_;
  v1::CameraReply reply_;
  bool ticked_ = false, stepped_ = false, wrong_ = false, moved_by_client_ = false;
  double time_s_ = 0.0, pending_s_ = 0.0;
};

std::atomic<uint64_t> playing{0};

// Says which session to play again when a step ends the process.
void tell_session(int number) {
  std::fprintf(stderr, "session %llu: signal %d\n", static_cast<unsigned long long>(playing.load()), number);
  std::signal(number, SIG_DFL);
  std::raise(number);
}

int storm(SamplerDevice& device, uint64_t count, uint64_t seed, std::optional<uint64_t> only) {
  Shared shared(device);
  for (const v1::Shape& shape : usual_shapes()) shared.kept.push_back(geometry_of(shape, shared.library, shared.store));
  for (const auto& geometry : shared.kept) shared.extents.get(geometry);
  Counts counts;
  shared.prints = only.has_value();
  if (only) {
    Player(shared, seed, *only, counts).play(kTicksOfSession);
    return counts.wrong == 0 ? 0 : 1;
  }
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); };
  double told_s = 0;
  for (uint64_t session = 0; counts.ticks < count && counts.wrong < 20; ++session) {
    playing = session;
    Player(shared, seed, session, counts).play(std::min(kTicksOfSession, count - counts.ticks));
    if (seconds() < told_s + 30) continue;
    told_s = seconds();
    std::printf("%.0f s: %llu ticks\n", told_s, static_cast<unsigned long long>(counts.ticks)), std::fflush(stdout);
  }
  std::printf("longest step: %.0f ms, in session %llu\n", counts.longest_step_ms,
              static_cast<unsigned long long>(counts.longest_in));
  std::printf(
      "%llu sessions, %llu openings refused; %llu ticks, %llu refused; %llu replies, limits checked in %llu; %llu "
      "wrong; %.0f ticks a second\n",
      static_cast<unsigned long long>(counts.sessions), static_cast<unsigned long long>(counts.refused_openings),
      static_cast<unsigned long long>(counts.ticks), static_cast<unsigned long long>(counts.refused),
      static_cast<unsigned long long>(counts.replies), static_cast<unsigned long long>(counts.checked_limits),
      static_cast<unsigned long long>(counts.wrong), static_cast<double>(counts.ticks) / seconds());
  return counts.wrong == 0 ? 0 : 1;
}

int storm_with(const std::string& sampler, uint64_t count, uint64_t seed, std::optional<uint64_t> only) {
  if (sampler == "embree") return storm(*make_embree_sampler_device(), count, seed, only);
  if (sampler != "egl") return std::fputs("SAMPLER must be embree or egl\n", stderr), 2;
  const auto egl = make_egl_for_tests();
  if (!egl.device) return std::printf("skipped: %s\n", egl.why_not.c_str()), 77;
  return storm(*egl.device, count, seed, only);
}

}  // namespace
}  // namespace sightline::test

int main(int argc, char** argv) {
  if (argc < 2 || argc > 5) return std::fputs("usage: number_storm COUNT [SEED [SAMPLER [SESSION]]]\n", stderr), 2;
  const auto number = [&](int i, uint64_t otherwise) {
    return i < argc ? std::strtoull(argv[i], nullptr, 10) : otherwise;
  };
  google::protobuf::SetLogHandler(nullptr);
  for (const int signal : {SIGABRT, SIGSEGV, SIGFPE, SIGILL}) std::signal(signal, sightline::test::tell_session);
  return sightline::test::storm_with(argc > 3 ? argv[3] : "embree", number(1, 0), number(2, 1),
                                     argc > 4 ? std::optional<uint64_t>(number(4, 0)) : std::nullopt);
}
