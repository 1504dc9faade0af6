#!/usr/bin/env bash
# The tests of the service, of its threads and of what they share, under sanitizers: tests/sanitizers.sh [asan] [tsan] [daemon]
#
# Builds only what these tests need, into build/asan and build/tsan, and runs them, as many parts of programs at a time as there are processors.
# Then the daemon itself works for half a minute (soak/short_load.py). Without arguments it runs both sanitizers; `daemon` adds the tests that start
# the daemon, and those of sessions.
#
# AddressSanitizer comes with UndefinedBehaviorSanitizer, and every report fails. A report of ThreadSanitizer fails when it is about our code on
# both sides: Debian's gRPC is not instrumented, so what it hands from thread to thread looks like a race (service/tsan_reports.py).
set -euo pipefail
cd "$(dirname "$0")/.."
presets=() more=()
for word in "$@"; do
  case $word in
    asan | tsan) presets+=("$word") ;;
    # For AddressSanitizer only: sessions have no threads, and those of the daemon have their load with both sanitizers.
    daemon) more=(session_test daemon_test recording_daemon_test) ;;
    *) sed -n '2,/^set/{/^set/d;s/^# \?//;p}' "$0" >&2; exit 2 ;;
  esac
done
[ ${#presets[@]} -gt 0 ] || presets=(asan tsan)
deploy/install-packages.sh build

# Runs one part of a program's tests: test_part "PROGRAM INDEX". Writes what failed to $logs/failed: the program, and its tests as a --gtest_filter.
test_part() {
  read -r program index <<<"$1"
  local log=$logs/$program.$index
  # A part that hangs is ended, and the name of its test stands in the log.
  GTEST_TOTAL_SHARDS=$parts GTEST_SHARD_INDEX=$index timeout --foreground -s ABRT 900 "build/$preset/bin/$program" >"$log" 2>&1 && { grep -E '^\[(=+|  PASSED|  SKIPPED)' "$log" || true; return 0; }
  grep -vE '^\[ (RUN|      OK)' "$log" | tail -60; grep '^\[ RUN' "$log" | tail -1
  local failed=
  # A program that was killed does not say how many tests ran, and then all of them run again.
  ! grep -q '^\[=*\] .* ran' "$log" || failed=$(sed -n 's/^\[  FAILED  \] \([^ ,]*\.[^ ,]*\).*/\1/p' "$log" | sort -u | paste -sd:)
  echo "$program ${failed:-*}" >>"$logs/failed"
}
export -f test_part
parts=$(nproc)
export parts

for preset in "${presets[@]}"; do
  programs=(service_test gate_test schedule_test recorder_test)
  [ "$preset" != asan ] || programs+=("${more[@]}")
  SECONDS=0
  cmake --preset "$preset" -DSIGHTLINE_TESTS=ON >/dev/null
  cmake --build --preset "$preset" --parallel "$(nproc)" --target "${programs[@]}" sightlined soak_client
  echo "== $preset: built in $SECONDS s"
  SECONDS=0
  export preset reports=$PWD/build/$preset/reports logs=$PWD/build/$preset/logs
  rm -rf "$reports" "$logs"
  mkdir -p "$reports" "$logs"
  touch "$logs/failed"
  export ASAN_OPTIONS=detect_stack_use_after_return=0:log_path=$reports/report
  export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1:log_path=$reports/report
  # Without exitcode=0 a daemon would end with an error for reports that are not about our code.
  export TSAN_OPTIONS=suppressions=$PWD/tests/service/tsan.supp:exitcode=0:log_path=$reports/report
  for program in "${programs[@]}"; do
    for ((index = 0; index < parts; ++index)); do echo "$program $index"; done
  done | xargs -P "$parts" -I PART bash -c 'test_part "PART"'
  # Everything is several times slower here. A test for which a busy machine had no time gets another try, alone; reports count in any case.
  failed=0
  while read -r program tests; do
    echo "== $preset: $program --gtest_filter=$tests failed and gets another try"
    "build/$preset/bin/$program" --gtest_brief=1 --gtest_filter="$tests" || failed=1
  done <"$logs/failed"
  echo "== $preset: the daemon under a load of 30 s"
  /usr/bin/python3 tests/soak/short_load.py "build/$preset/bin/sightlined" "build/$preset/bin/soak_client" 30 || failed=1
  if [ "$preset" = tsan ]; then
    /usr/bin/python3 tests/service/tsan_reports.py "$reports" || failed=1
  elif [ -n "$(ls "$reports")" ]; then
    cat "$reports"/*
    failed=1
  fi
  echo "== $preset: tested in $SECONDS s"
  [ $failed = 0 ] || exit 1
done
