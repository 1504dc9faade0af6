#!/usr/bin/env bash
# Changes the program in small ways, one at a time, and counts which changes the tests notice: tests/mutation.sh [OPTION...] [FOLDER...]
#
#   tests/mutation.sh                       20 mutants of every folder of server/ and client/
#   tests/mutation.sh --per-folder 50       30 more of each: what has a result is not tried again
#   tests/mutation.sh --per-folder 50 server/move server/record
#   tests/mutation.sh --programs 1 server/bound      a quick look, with the unit tests alone
#   tests/mutation.sh --again server/move            only those that have survived, after tests were added
#   tests/mutation.sh --learn               builds everything, and learns which tests come past which mutants and how long they take
#
# The options are those of mutation/run_mutants.py. A copy of the sources, in build/mutation, is compiled once with the mutants to
# try (mutation/instrument.py says what is changed), and a variable of the environment switches one on. The results are written to
# build/mutation/results.json, and the page results/trust is made from them. All folders take hours; a run that is stopped keeps its results,
# and the same command goes on.
set -euo pipefail
cd "$(dirname "$0")/.."
export SIGHTLINE_REQUIRE_EGL=1  # a mutant that finds no OpenGL is killed, not skipped
deploy/install-packages.sh build
deploy/install-packages.sh mutation
root=$PWD
tree=$root/build/mutation
build=$tree/source/build/release
options=() folders=() programs=9 per_folder=20 seed=1
while [ $# -gt 0 ]; do
  case $1 in
    --again | --fresh | --learn) options+=("$1"); shift ;;
    --*)
      case $1 in --programs) programs=$2 ;; --per-folder) per_folder=$2 ;; --seed) seed=$2 ;; esac
      options+=("$1" "$2"); shift 2 ;;
    *) folders+=("${1%/}"); shift ;;
  esac
done
near() { PYTHONPATH=tests/mutation /usr/bin/python3 -c "from nearest import *; import sys; $1" "${folders[@]}"; }
[ ${#folders[@]} -gt 0 ] || mapfile -t folders < <(near 'print(*NEAREST, sep="\n")')
jobs=$(nproc)

rewrite() {
  /usr/bin/python3 tests/mutation/rewrite.py "$root" "$tree" build/release/compile_commands.json "$jobs" "$seed" "$per_folder" "${folders[@]}"
}
compile() { cmake --build "$build" --parallel "$jobs" --target "$@" -- -k 0 2>&1 | tee "$tree/build.log"; }

# A fresh clone goes on from the results on the page.
mkdir -p "$tree"
[ -e "$tree/results.json" ] || cp tests/results/trust/mutants.json "$tree/results.json"
cmake --preset release -DSIGHTLINE_TESTS=ON >/dev/null
cmake --build --preset release --target sightline_settings_code sightline_proto sightline_viewer_proto sightline_page_template --parallel "$jobs" >/dev/null
rewrite
cmake -S "$tree/source" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSIGHTLINE_TESTS=ON -DSIGHTLINE_MUTATION=ON >/dev/null
tests=$(near "print(*{t for f in sys.argv[1:] for t in NEAREST[f][:$programs]})")
# shellcheck disable=SC2086
targets=$(/usr/bin/python3 tests/mutation/programs.py "$build" $tests)
# Mutants that the compiler refuses are left out, and the rest is built.
until compile $targets; do
  /usr/bin/python3 tests/mutation/refuse.py "$tree/build.log" "$tree" || exit 1
  rewrite
done
exec /usr/bin/python3 tests/mutation/run_mutants.py "$build" "$tree/mutants.json" "$tree/results.json" "${options[@]}" "${folders[@]}"
