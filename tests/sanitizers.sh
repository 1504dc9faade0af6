#!/usr/bin/env bash
# The tests of the service, of its threads and of what they share, under sanitizers: tests/sanitizers.sh [asan] [tsan]
#
# Builds only what these tests need, into build/asan and build/tsan, and runs them; both without arguments. AddressSanitizer comes with
# UndefinedBehaviorSanitizer, and every report fails. A report of ThreadSanitizer fails when it is about our code on
# both sides: Debian's gRPC is not instrumented, so what it hands from thread to thread looks like a race (service/tsan_reports.py).
set -euo pipefail
cd "$(dirname "$0")/.."
presets=("$@")
[ ${#presets[@]} -gt 0 ] || presets=(asan tsan)
programs=(service_test schedule_test recorder_test session_test)
deploy/install-packages.sh build
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
export ASAN_OPTIONS=detect_stack_use_after_return=0
for preset in "${presets[@]}"; do
  SECONDS=0
  cmake --preset "$preset" -DSIGHTLINE_TESTS=ON >/dev/null
  cmake --build --preset "$preset" --parallel "$(nproc)" --target "${programs[@]}"
  echo "== $preset: built in $SECONDS s"
  SECONDS=0
  reports=build/$preset/reports
  rm -rf "$reports"
  mkdir -p "$reports"
  for program in "${programs[@]}"; do
    TSAN_OPTIONS="suppressions=$PWD/tests/service/tsan.supp exitcode=0 log_path=$PWD/$reports/$program" \
      "build/$preset/bin/$program" --gtest_brief=1
  done
  /usr/bin/python3 tests/service/tsan_reports.py "$reports"
  echo "== $preset: tested in $SECONDS s"
done
