#!/usr/bin/env bash
# The tests of the service, of its threads and of what they share, under sanitizers: tests/sanitizers.sh [asan] [tsan]
#
# Builds only what these tests need, into build/asan and build/tsan, and runs them, as many programs at a time as there are processors; both
# without arguments. AddressSanitizer comes with UndefinedBehaviorSanitizer, and every report fails. A report of ThreadSanitizer fails when it is
# about our code on both sides: Debian's gRPC is not instrumented, so what it hands from thread to thread looks like a race
# (service/tsan_reports.py).
set -euo pipefail
cd "$(dirname "$0")/.."
presets=("$@")
[ ${#presets[@]} -gt 0 ] || presets=(asan tsan)
with_threads=(service_test gate_test schedule_test recorder_test)
# Under AddressSanitizer only. Sessions have no threads. The others start the daemon, which ThreadSanitizer would end with an error for reports
# that are not ours.
others=(session_test daemon_test recording_daemon_test)
deploy/install-packages.sh build
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
export ASAN_OPTIONS=detect_stack_use_after_return=0

for preset in "${presets[@]}"; do
  programs=("${with_threads[@]}")
  [ "$preset" != asan ] || programs+=("${others[@]}")
  SECONDS=0
  cmake --preset "$preset" -DSIGHTLINE_TESTS=ON >/dev/null
  cmake --build --preset "$preset" --parallel "$(nproc)" --target "${programs[@]}"
  echo "== $preset: built in $SECONDS s"
  SECONDS=0
  reports=$PWD/build/$preset/reports
  rm -rf "$reports"
  mkdir -p "$reports"
  suppressions=$PWD/tests/service/tsan.supp
  failed=0
  printf '%s\n' "${programs[@]}" | TSAN_OPTIONS="suppressions=$suppressions exitcode=0 log_path=$reports/report" \
    xargs -P "$(nproc)" -I PROGRAM env "build/$preset/bin/PROGRAM" --gtest_brief=1 || failed=1  # xargs replaces nothing in the command's own name
  /usr/bin/python3 tests/service/tsan_reports.py "$reports" || failed=1
  echo "== $preset: tested in $SECONDS s"
  [ $failed = 0 ] || exit 1
done
