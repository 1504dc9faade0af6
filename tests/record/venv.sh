#!/usr/bin/env bash
# Makes a Python environment with tests/record/requirements.txt in it; does nothing, quickly, when it is there.
#   tests/record/venv.sh <folder>
set -euo pipefail
requirements="$(cd "$(dirname "$0")" && pwd)/requirements.txt"
folder=$1
[ -e "$folder/requirements.txt" ] && cmp -s "$requirements" "$folder/requirements.txt" && exit 0
rm -rf "$folder"
/usr/bin/python3 -m venv "$folder"
"$folder/bin/pip" install --quiet --disable-pip-version-check --only-binary :all: --requirement "$requirements"
cp "$requirements" "$folder/requirements.txt"
