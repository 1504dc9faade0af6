#!/usr/bin/env bash
# Changes the program in small ways, one at a time, and counts which changes the tests notice: tests/mutation.sh [OPTION...] [FOLDER...]
#
#   tests/mutation.sh                       20 mutants of every folder of server/ and client/
#   tests/mutation.sh --per-folder 50 server/move server/record
#   tests/mutation.sh --programs 1 server/bound                           a quick look, with the unit tests alone
#   tests/mutation.sh --again build/mutation/results.json server/move    only those that survived before
#
# The options are those of mutation/run_mutants.py. A copy of the sources, in build/mutation, is compiled once with all its mutants
# (mutation/instrument.py says what is changed), and a variable of the environment switches one on. The results are written to
# build/mutation/results.json, and the page results/trust is made from them. All folders take hours.
set -euo pipefail
cd "$(dirname "$0")/.."
export SIGHTLINE_REQUIRE_EGL=1  # a mutant that finds no OpenGL is killed, not skipped
deploy/install-packages.sh build
deploy/install-packages.sh mutation
root=$PWD
tree=$root/build/mutation
options=() folders=() programs=9
while [ $# -gt 0 ]; do
  case $1 in
    --*)
      [ "$1" = --programs ] && programs=$2
      options+=("$1" "$2"); shift 2 ;;
    *) folders+=("${1%/}"); shift ;;
  esac
done
near() { PYTHONPATH=tests/mutation /usr/bin/python3 -c "from nearest import *; import sys; $1" "${folders[@]}"; }
[ ${#folders[@]} -gt 0 ] || mapfile -t folders < <(near 'print(*NEAREST, sep="\n")')
jobs=$(nproc)

# The copy, fresh but for its build folder. Files keep their times unless they change, so a second run compiles little.
fresh=$tree/fresh
rm -rf "$fresh"
mkdir -p "$fresh" "$tree/source"
git ls-files -z --cached --others --exclude-standard | xargs -0 cp --parents -pt "$fresh"
cmake --preset release -DSIGHTLINE_TESTS=ON >/dev/null
cmake --build --preset release --target sightline_settings_code sightline_proto sightline_viewer_proto sightline_page_template --parallel "$jobs" >/dev/null
mapfile -t sources < <(for folder in "${folders[@]}"; do find "$folder" -maxdepth 1 -name '*.cpp' ! -name example.cpp | sort; done)
/usr/bin/python3 tests/mutation/instrument.py "$root" "$fresh" build/release/compile_commands.json "$tree/mutants.json" "$jobs" "${sources[@]}"
(cd "$fresh" && find . -type f -print0 | while IFS= read -r -d '' file; do
  cmp -s "$file" "$tree/source/$file" || { mkdir -p "$tree/source/$(dirname "$file")" && cp "$file" "$tree/source/$file"; }
done)
mapfile -t targets < <(near 'print(*{x for f in sys.argv[1:] for t in NEAREST[f][:'"$programs"'] for x in ((t,) if is_program(t) else ("sightlined", "sightline", "sightline_python_stubs"))}, sep="\n")')
cmake -S "$tree/source" -B "$tree/source/build/release" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSIGHTLINE_TESTS=ON "-DSIGHTLINE_MUTATION=$(IFS=';'; echo "${folders[*]}")" >/dev/null
cmake --build "$tree/source/build/release" --parallel "$jobs" --target "${targets[@]}"
exec /usr/bin/python3 tests/mutation/run_mutants.py "$tree/source/build/release" "$tree/mutants.json" "$tree/results.json" "${options[@]}" "${folders[@]}"
