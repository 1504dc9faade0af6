#include "server/signals.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <string>

namespace sightline {
namespace {

constexpr int kMostSignals = 64;

bool left_to_others(int signal) {
  struct sigaction now {};
  return ::sigaction(signal, nullptr, &now) != 0 || (now.sa_flags & SA_SIGINFO) != 0 ||
         (now.sa_handler != SIG_DFL && now.sa_handler != SIG_IGN);
}

// Text of a bounded length, made without memory or locks: a signal handler may use it.
class Line {
 public:
  Line& add(const char* text) {
    while (*text != '\0' && size_ < sizeof(bytes_)) bytes_[size_++] = *text++;
    return *this;
  }
  Line& add(unsigned number, int digits) {
    char text[12];
    for (int i = digits; i-- > 0; number /= 10) text[i] = static_cast<char>('0' + number % 10);
    text[digits] = '\0';
    return add(text);
  }
  void write(int fd) const {
    const ssize_t ignored = ::write(fd, bytes_, size_);
    (void)ignored;
  }

 private:
  char bytes_[256];
  size_t size_ = 0;
};

// As the log writes it.
void add_time(Line& line) {
  using namespace std::chrono;
  const auto now = time_point_cast<milliseconds>(system_clock::now());
  const auto day = floor<days>(now);
  const year_month_day date(day);
  const hh_mm_ss time(now - day);
  line.add(static_cast<unsigned>(static_cast<int>(date.year())), 4)
      .add("-")
      .add(static_cast<unsigned>(date.month()), 2)
      .add("-");
  line.add(static_cast<unsigned>(date.day()), 2).add("T").add(static_cast<unsigned>(time.hours().count()), 2).add(":");
  line.add(static_cast<unsigned>(time.minutes().count()), 2)
      .add(":")
      .add(static_cast<unsigned>(time.seconds().count()), 2)
      .add(".");
  line.add(static_cast<unsigned>(time.subseconds().count()), 3).add("Z");
}

// The system's own handler, which may leave a core, is back when this one ends (SA_RESETHAND), and gets the signal
// again.
template <LogFormat format>
void last_words(int signal) {
  const char* const name = ::sigabbrev_np(signal);
  Line line;
  if (format == LogFormat::kJson) {
    line.add("{\"time\":\"");
    add_time(line);
    line.add("\",\"level\":\"error\",\"message\":\"the process ends\",\"signal\":\"SIG")
        .add(name ? name : "?")
        .add("\"}\n");
  } else {
    add_time(line);
    line.add(" error the process ends signal=SIG").add(name ? name : "?").add("\n");
  }
  line.write(STDERR_FILENO);
  ::raise(signal);
}

}  // namespace

SignalUse use_of(int signal) {
  switch (signal) {
    case SIGTERM:
    case SIGINT:
    case SIGQUIT:
    case SIGPWR:   // the power fails; containers are stopped by it too
    case SIGXCPU:  // the limit of processor time is near, and then the process is killed
      return SignalUse::kStops;
    case SIGHUP:
      return SignalUse::kReadsAgain;
    case SIGPIPE:  // a reader is gone
    case SIGXFSZ:  // a file is as large as it may be
      return SignalUse::kIgnored;
    case SIGABRT:
    case SIGBUS:
    case SIGFPE:
    case SIGILL:
    case SIGSEGV:
    case SIGSYS:
    case SIGTRAP:
      return SignalUse::kLastWords;
    case SIGKILL:
    case SIGSTOP:
    case SIGTSTP:
    case SIGTTIN:
    case SIGTTOU:
    case SIGCONT:
    case SIGCHLD:
    case SIGURG:
    case SIGWINCH:
      return SignalUse::kLeft;
    default:  // SIGALRM, SIGVTALRM, SIGPROF, SIGIO, SIGSTKFLT, SIGUSR1, SIGUSR2
      break;
  }
  // The C library keeps the first real-time signals for itself.
  const bool usable = signal >= 1 && (signal < kMostSignals / 2 || (signal >= SIGRTMIN && signal <= SIGRTMAX));
  return usable ? SignalUse::kTold : SignalUse::kLeft;
}

sigset_t awaited_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (int signal = 1; signal <= kMostSignals; ++signal) {
    const SignalUse use = use_of(signal);
    const bool ours = use == SignalUse::kStops || use == SignalUse::kReadsAgain ||
                      (use == SignalUse::kTold && !left_to_others(signal));
    if (ours) sigaddset(&signals, signal);
  }
  return signals;
}

void take_over_signals() {
  for (int signal = 1; signal <= kMostSignals; ++signal)
    if (use_of(signal) == SignalUse::kIgnored) std::signal(signal, SIG_IGN);
  const sigset_t signals = awaited_signals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
}

void say_last_words(LogFormat format, LogLevel level) {
  if (level == LogLevel::kOff) return;
  struct sigaction action {};
  action.sa_handler = format == LogFormat::kJson ? &last_words<LogFormat::kJson> : &last_words<LogFormat::kText>;
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigemptyset(&action.sa_mask);
  for (int signal = 1; signal <= kMostSignals; ++signal)
    if (use_of(signal) == SignalUse::kLastWords && !left_to_others(signal)) ::sigaction(signal, &action, nullptr);
}

std::string signal_name(int signal) {
  if (const char* const name = ::sigabbrev_np(signal)) return std::string("SIG") + name;
  if (signal >= SIGRTMIN && signal <= SIGRTMAX) return "SIGRTMIN+" + std::to_string(signal - SIGRTMIN);
  return "signal " + std::to_string(signal);
}

void be_told_before_cpu_limit(double before_s) {
  rlimit limit{};
  if (::getrlimit(RLIMIT_CPU, &limit) != 0 || limit.rlim_max == RLIM_INFINITY) return;
  const auto before = static_cast<rlim_t>(std::ceil(before_s));
  const rlim_t soft = limit.rlim_max > before ? limit.rlim_max - before : 1;
  limit.rlim_cur = std::min(limit.rlim_cur, soft);
  ::setrlimit(RLIMIT_CPU, &limit);
}

}  // namespace sightline
