#!/usr/bin/env bash
# Makes the page on trust: README.md in this folder. Everything on it comes from files beside it, which these runs write:
#   tests/results/trust/make.sh                 # attacks, deltas, version skew; then the page. 30 minutes on 2 idle cores
#   tests/results/trust/make.sh --mixes N       # N mixes of frames as well; 1,000 take 45 minutes
#   tests/results/trust/make.sh --soak HOURS    # a soak as well
#   tests/results/trust/make.sh --faults        # 10,000 killed streams and 100 killed daemons as well; 6 minutes
#   tests/results/trust/make.sh --fuzz MINUTES  # fuzzing as well; its executions are added to those of former runs
#   tests/results/trust/make.sh --mutants N     # N mutants of each folder as well; hours. Those with a result are not tried again
#   tests/results/trust/make.sh --page          # the page alone
set -euo pipefail
cd "$(dirname "$0")/../../.."
here=tests/results/trust mixes="" soak="" faults=false fuzz="" mutants="" page_only=false
while [ $# -gt 0 ]; do
  case $1 in
    --mixes) mixes=$2; shift 2 ;;
    --soak) soak=$2; shift 2 ;;
    --faults) faults=true; shift ;;
    --fuzz) fuzz=$2; shift 2 ;;
    --mutants) mutants=$2; shift 2 ;;
    --page) page_only=true; shift ;;
    *) sed -n '2,/^set/{/^set/d;s/^# \?//;p}' "$0" >&2; exit 2 ;;
  esac
done
# A verdict that fails is on the page, and does not keep the page from being made.
status=0
if ! $page_only; then
  deploy/install-packages.sh build
  cmake --preset release -DSIGHTLINE_TESTS=ON >/dev/null
  cmake --build --preset release --parallel "$(nproc)" --target sightlined delta_storm sightline_python_stubs
  bin=build/release/bin
  (cd tests/attack && /usr/bin/python3 measure.py "../../$bin/sightlined" ../../build/release/python --out "../../$here/attacks.json" \
    --probes-out "../../$here/probes.json") || status=1
  "$bin/delta_storm" 100000 >"$here/deltas.txt" || status=1
  /usr/bin/python3 tests/skew/skew_test.py "$bin/sightlined" build/release/python || status=1
fi
if [ -n "$mixes" ]; then
  (cd tests/attack && /usr/bin/python3 mixes.py ../../build/release/bin/sightlined ../../build/release/python --mixes "$mixes" \
    --out ../../build/mixes.json) || status=1
  /usr/bin/python3 "$here/make_page.py" --mixes build/mixes.json
fi
if [ -n "$soak" ]; then
  tests/soak.sh "$soak" || status=1
  cp build/soak/soak.json "$here/soak.json"
fi
if $faults; then
  tests/fault.sh || status=1
  cp build/faults.json "$here/faults.json"
fi
if [ -n "$fuzz" ]; then
  tests/fuzz.sh "$fuzz" || status=1
  /usr/bin/python3 "$here/make_page.py" --add-executions build/fuzz/executions
  rm build/fuzz/executions
fi
if [ -n "$mutants" ]; then
  tests/mutation.sh --per-folder "$mutants" || status=1
  cp build/mutation/results.json "$here/mutants.json"
fi
/usr/bin/python3 "$here/make_page.py"
exit "$status"
