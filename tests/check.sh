#!/usr/bin/env bash
# The checks that need no build, in seconds: format, scripts, and the layers where a folder is configured. Nothing is changed.
#   tests/check.sh          all files
#   tests/check.sh --tidy   also clang-tidy, on the C++ files that differ from the last commit; they must have been built
# As a hook: ln -s ../../tests/check.sh .git/hooks/pre-commit
set -euo pipefail
cd "$(git rev-parse --show-toplevel)"
build=build/${PRESET:-release}
failed=0
# Runs a check and says how it ended; its output is shown where it failed.
check() {
  local name=$1 output status=0
  shift
  output=$("$@" 2>&1) || status=$?
  if [ "$status" = 0 ]; then echo "ok      $name"; return; fi
  echo "FAILED  $name"
  printf '%s\n' "$output" | head -40
  failed=1
}
left_out() { echo "-       $1: left out, $2"; }

format() {
  git ls-files -z '*.cpp' '*.h' | xargs -0 -P "$(nproc)" -n 64 clang-format-14 --dry-run --Werror
}
# Every shell script is read by bash, and every Python file by Python.
shell_scripts() {
  git ls-files -z '*.sh' .ci/run | xargs -0 -n 1 bash -n
}
python_files() {
  git ls-files -z '*.py' | xargs -0 /usr/bin/python3 -c 'import ast, sys
for name in sys.argv[1:]:
    ast.parse(open(name, encoding="utf-8").read(), name)'
}
# No merge marker, and no blank at the end of a line.
whitespace() {
  git diff --check "$(git hash-object -t tree /dev/null)" -- '*.cpp' '*.h' '*.py' '*.sh' '*.proto' '*.md' '*.txt' '*.cmake'
}
tidy() {
  git diff --name-only -z HEAD -- '*.cpp' | xargs -0 -r -P "$(nproc)" -n 1 clang-tidy-14 --quiet --warnings-as-errors='*' -p "$build"
}

if command -v clang-format-14 >/dev/null; then check format format; else left_out format "clang-format-14 is not installed"; fi
check "shell scripts" shell_scripts
check "Python files" python_files
check whitespace whitespace
if [ -f "$build/link_graph.json" ]; then
  check layers /usr/bin/python3 tests/house/layers_test.py . "$build/link_graph.json"
else
  left_out layers "$build is not configured with tests"
fi
if [ "${1:-}" = --tidy ]; then check "clang-tidy" tidy; fi
exit "$failed"
