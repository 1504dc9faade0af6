// What the daemon does with each signal whose ordinary effect is to end the process. No signal ends it without a word.
#pragma once

#include <csignal>
#include <string>

#include "server/service/log.h"

namespace sightline {

enum class SignalUse {
  kStops,       // it drains, as an orderly stop does
  kReadsAgain,  // configuration and credentials are read again
  kTold,        // nothing happens, and the log says that it came
  kIgnored,     // nothing happens: the call that caused it fails and is dealt with there
  kLastWords,   // the process ends, and its last line names the signal
  // as the system has it: the signal cannot be caught, stops or goes on with the process, or does nothing anyway
  kLeft,
};
SignalUse use_of(int signal);

// The signals to wait for with sigtimedwait: kStops, kReadsAgain and kTold.
sigset_t awaited_signals();
// A stop signal, and one that also ends the wait for the sessions when it comes while they drain. SIGXCPU comes every
// second.
inline bool stops(int signal) {
  return use_of(signal) == SignalUse::kStops;
}
inline bool hurries(int signal) {
  return stops(signal) && signal != SIGXCPU;
}

// Runs before any thread starts, because threads inherit the mask. Signals that something else in the process handles,
// such as a sanitizer or a profiler, are left to it.
void take_over_signals();
// The form of the last words; none before it is called, nor with a log that is off.
void say_last_words(LogFormat format, LogLevel level);

// "SIGTERM", "SIGRTMIN+3", "signal 99"
std::string signal_name(int signal);

// Where `ulimit -t` would kill the process at once, SIGXCPU comes this much processor time before, so that sessions can
// drain.
void be_told_before_cpu_limit(double before_s);

}  // namespace sightline
