#!/usr/bin/env bash
# Makes the results pages. Builds, plays the paper's tables and all scenes, and writes README.md, levels.md, CSV files and plots
# into this folder.
#   tests/results/make.sh            # eight seeds; eight hours and more on two cores that have nothing else to do, most of it for the ceiling
#   tests/results/make.sh --seeds 3  # fewer or more seeds
#   tests/results/make.sh --own      # plays only the default again, in all scenes but those of Tables 1 to 3, with as many seeds as it has there: an hour
#   tests/results/make.sh --quick    # a trial: one seed and fewer frames, into out/results/quick
#   SIGHTLINE_BIN=path/to/bin tests/results/make.sh   # use these programs and build nothing
#   SIGHTLINE_MOTION=path/to/recordings tests/results/make.sh   # also recorded motion; left out without it
#   SIGHTLINE_TILES=path/to/tiles tests/results/make.sh   # also the levels composed of the tiles in this folder; left out without it
set -euo pipefail
cd "$(dirname "$0")/../.."

own=false page=tests/results seeds=8 frames=2000 rate=60 paper_every=4 scenes_every=10
case "${1:-}" in
  "") ;;
  --seeds) seeds=$2 ;;
  --own) own=true ;;
  --quick) page=out/results/quick seeds=1 frames=200 paper_every=12 scenes_every=12 ;;
  *) echo "usage: $0 [--seeds N | --own | --quick]" >&2; exit 2 ;;
esac
raw=out/results/raw

if [ -z "${SIGHTLINE_BIN:-}" ]; then
  deploy/install-packages.sh build
  cmake --preset release >/dev/null
  cmake --build --preset release --parallel "$(nproc)" --target sightline step_bench
  SIGHTLINE_BIN=build/release/bin
fi

# The lines of paper_settings.txt whose names match, as flags.
settings=() shown=""
paper_settings() {
  settings=() shown=""
  while IFS= read -r line; do settings+=(--settings "$line"); done < <(grep -E "^($1)" tests/results/paper_settings.txt)
  shown="--settings <each of $1 in paper_settings.txt>"
}
commands=""
# Folder below $raw, then the flags that the page shows.
evaluate() {
  local folder=$1 seeds=$seeds
  shift
  # As many seeds as the table has of the default.
  if $own && [ -f "$page/$folder.csv" ]; then seeds=$(grep -E ',(sightline|wide),' "$page/$folder.csv" | cut -d, -f2 | sort -nu | wc -l); fi
  "$SIGHTLINE_BIN/sightline" evaluate --seeds "$seeds" --rate "$rate" "$@" "${settings[@]}" --out "$raw/$folder" >"$raw/$folder.txt"
  commands+="sightline evaluate --seeds $seeds --rate $rate $* $shown"$'\n'
}

rm -rf "$raw" && mkdir -p "$raw"
SECONDS=0
if ! $own; then
  # Measured first, while nothing else runs.
  "$SIGHTLINE_BIN/step_bench" --frames "$frames" --csv "$raw/table1.csv"
  commands+="step_bench --frames $frames"$'\n'
  # EGL draws the maps of the paper's tables, as there; Embree is beside it.
  for sampler in egl embree; do
    of=$([ "$sampler" = egl ] || echo -embree)
    paper_settings 'basic|robust|center'
    for scene in hall hall-front; do
      evaluate "$scene$of" --sampler "$sampler" --scene "$scene" --truth-every "$paper_every" --policy follow --policy spring-arm --policy raycast --policy sightline
    done
    paper_settings 'stability'
    evaluate "fence$of" --sampler "$sampler" --scene fence --scene fence-board --truth-every "$paper_every" --policy sightline
    paper_settings 'agile'
    evaluate "agile$of" --sampler "$sampler" --scene fence-agile --truth-every "$paper_every" --policy sightline
  done
fi
settings=() shown=""
# The cameras that play in most scenes; none named: all but the ceilings.
cameras=()
if $own; then cameras=(--policy sightline); fi
evaluate scenes --truth-every "$scenes_every" "${cameras[@]}"
settings=() shown="--settings <keep_shot 0, 0.25, 0.5 and 2>"
for share in 0:0 025:0.25 05:0.5 2:2; do settings+=(--settings "keep-${share%:*}={\"settings\":{\"keep_shot\":${share#*:}}}"); done
evaluate keep-shot --truth-every "$scenes_every" --group study --policy sightline
settings=() shown=""
roof_cameras=("${cameras[@]}")
$own || roof_cameras=(--policy sightline --policy spring-arm --policy raycast)
subject_cameras=("${cameras[@]}")
$own || subject_cameras=(--policy sightline --policy spring-arm)
evaluate roofs --truth-every 20 --group roofs "${roof_cameras[@]}"
evaluate subjects --truth-every 10 --group subjects "${subject_cameras[@]}"
if [ -n "${SIGHTLINE_MOTION:-}" ]; then evaluate motion --truth-every 10 --group motion "${subject_cameras[@]}"; fi
# The shots that these scenes are made for.
settings=(--settings "chase=$("$SIGHTLINE_BIN/sightline" shots chase --subject 1)") shown="--settings <the named shot chase of the subject 1>"
evaluate subjects-chase --truth-every 10 --scene runner --policy follow
settings=(--settings "over-right-shoulder=$("$SIGHTLINE_BIN/sightline" shots over-right-shoulder --subject 2 --other 4)") shown="--settings <the named shot over-right-shoulder of the subject 2 and the other 4>"
evaluate subjects-shoulder --truth-every 10 --scene conversation --policy follow
settings=() shown=""
sheet_scenes=()
for scene in hall rooms doors cycle crowd forest roof-two-walk roof-four level-roofed-row level-halls-crossing street pitch; do sheet_scenes+=(--scene "$scene"); done
seeds=1 evaluate sheets --truth-every 60 "${sheet_scenes[@]}" --policy spring-arm --policy sightline --sheets
# Each shot by its name, with the first target as the subject and the second as the other.
settings=() shown="--settings <each named shot of the subject 1 and the other 2>"
for shot in wide medium close two-shot chase side top-down orbit; do
  settings+=(--settings "$shot=$("$SIGHTLINE_BIN/sightline" shots "$shot" --subject 1 --other 2)")
done
named_scenes=()
for scene in hall forest city rooms level-rooms-beside level-roofed-row roof-two-walk; do named_scenes+=(--scene "$scene"); done
evaluate named-shots --truth-every 20 "${named_scenes[@]}" --policy follow
settings=() shown=""
worth_cameras=(--policy sightline)
$own || worth_cameras+=(--policy ceiling-worth)
evaluate worth-ceiling --first-seed 101 --truth-every 20 --group roofs --scene rooms --scene doors --scene corridors --scene forest --scene crowd "${worth_cameras[@]}"
level_groups=(--group levels)
if [ -n "${SIGHTLINE_TILES:-}" ]; then
  if $own; then seeds=2 evaluate tiles --truth-every "$scenes_every" --group tiles "${cameras[@]}"; else level_groups+=(--group tiles); fi
fi
evaluate levels --truth-every "$scenes_every" --group situations "${level_groups[@]}" "${cameras[@]}"
if $own; then
  seeds=1 evaluate hall-s1 --scene hall --truth-every "$scenes_every"
  python3 tests/results/make_page.py "$page" --renew "$raw"
  echo "The pages are $page/README.md and $page/levels.md"
  exit
fi
# The ceiling needs several seconds for each second of a scene: ten to twenty minutes for each seed of a group. Seeds that were played on
# other days can be added to ceiling.csv, since they depend on the scene alone. The page says how many each scene has.
# It has no figures for the sprints, where it may not count pictures from where the camera has fallen behind, nor for walled-in, where it does not
# leave the wall.
situations=()
for scene in corridor-one corridor-narrow doors-roofed maze maze-roofed stairwell lift street block pitch parting leaving teleport; do situations+=(--scene "$scene"); done
evaluate ceiling --truth-every "$scenes_every" --policy ceiling --group study "${situations[@]}" "${level_groups[@]}"
minutes=$(((SECONDS + 59) / 60))

python3 tests/results/make_page.py "$page" --raw "$raw" --how "commands=$commands" --how "rate_hz=$rate" --how "seeds=$seeds seed(s)" --how "level_seeds=$seeds seed(s)" \
  --how "paper_every=$paper_every" --how "scenes_every=$scenes_every" --how "minutes=$minutes" --how "cores=$(nproc)"
echo "The pages are $page/README.md and $page/levels.md"
