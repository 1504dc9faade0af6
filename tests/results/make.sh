#!/usr/bin/env bash
# Makes the results page again: builds, plays the paper's tables and all scenes, and writes README.md, CSVs and plots here.
#   tests/results/make.sh            # five seeds; 15 to 20 minutes on two cores that have nothing else to do
#   tests/results/make.sh --quick    # one seed, fewer frames, into out/results/quick instead of here; for trying
#   SIGHTLINE=path/to/sightline tests/results/make.sh   # with this program, without building
set -euo pipefail
cd "$(dirname "$0")/../.."

page=tests/results seeds=5 frames=2000 rate=60 paper_every=4 scenes_every=10
case "${1:-}" in
  "") ;;
  --quick) page=out/results/quick seeds=1 frames=200 paper_every=12 scenes_every=12 ;;
  *) echo "usage: $0 [--quick]" >&2; exit 2 ;;
esac
raw=out/results/raw

if [ -z "${SIGHTLINE:-}" ]; then
  deploy/install-packages.sh build
  cmake --preset release >/dev/null
  cmake --build --preset release --parallel "$(nproc)" --target sightline
  SIGHTLINE=build/release/bin/sightline
fi

paper=(evaluate --suite paper --seeds "$seeds" --rate "$rate" --truth-every "$paper_every" --frames "$frames")
scenes=(evaluate --suite scenes --seeds "$seeds" --rate "$rate" --truth-every "$scenes_every")
for policy in follow spring-arm raycast paper sightline; do scenes+=(--policy "$policy"); done

rm -rf "$raw"
SECONDS=0
"$SIGHTLINE" "${paper[@]}" --out "$raw/paper"
"$SIGHTLINE" "${scenes[@]}" --out "$raw/scenes" >/dev/null
minutes=$(((SECONDS + 59) / 60))

python3 tests/results/make_page.py "$page" --paper "$raw/paper" --scenes "$raw/scenes" \
  --how "paper_command=sightline ${paper[*]}" --how "scenes_command=sightline ${scenes[*]}" --how "rate_hz=$rate" \
  --how "seeds=$seeds" --how "paper_every=$paper_every" --how "scenes_every=$scenes_every" --how "minutes=$minutes" --how "cores=$(nproc)"
echo "The page is $page/README.md"
