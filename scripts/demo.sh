#!/usr/bin/env bash
# The method in one go, from a bare Debian 12: installs what is missing, builds, renders a modest reference, trains a
# radiance cache for the glossy room, renders it with one query a sample, and compares that with path tracing given the
# same time. Results land in demo/. About 12 minutes on two cores.
#   scripts/demo.sh            the whole thing
#   scripts/demo.sh --quick    the same steps, small and short, to see that they run (the pictures are poor)
set -euo pipefail
cd "$(dirname "$0")/.."

train_time=3m reference_time=150s noise_time=25s size=()
case "${1:-}" in
  "") ;;
  --quick) train_time=5s reference_time=4s noise_time=1s size=(--width 160) ;;
  *) echo "usage: scripts/demo.sh [--quick]" >&2; exit 1 ;;
esac

started=$SECONDS
step() { printf '\n== %s\n' "$*"; }
show() { printf '+ %s\n' "$*" >&2; "$@"; }  # its output may go to a file
# field FILE NAME: a number of what --json printed: of a rendering, or of a comparison's picture. What lies deeper, as the
# rows by roughness, is indented further and not taken.
field() { sed -n "s/^ \{2,6\}\"$2\": *\(-\{0,1\}[0-9.][0-9.e+-]*\).*/\1/p" "$1" | head -n 1; }

step "Installing what is missing and building"
scripts/install_deps.sh
if [ -n "${OCTRAD_BUILD:-}" ]; then build=$OCTRAD_BUILD; else build=build; scripts/build.sh build; fi
PATH="$(cd "$build" && pwd):$PATH"
mkdir -p demo
scene=scenes/glossy-room/scene.xml

step "A path-traced reference ($reference_time), and a second one with other random numbers to know its noise"
show octrad render $scene --integrator path --spp 100000 --time $reference_time "${size[@]}" -o demo/ref.exr --json >demo/ref.json
show octrad render $scene --integrator path --spp 100000 --time $noise_time "${size[@]}" --seed 1 -o demo/noise.exr --json >demo/noise.json

step "Training the cache ($train_time)"
show octrad train $scene -o demo/room.octrad --overwrite --preset cpu --time $train_time --reference demo/ref.exr

step "The cache's picture: one query a sample"
show octrad render $scene --integrator lhs --model demo/room.octrad "${size[@]}" -o demo/lhs.exr --json >demo/lhs.json

step "Path tracing in the same time"
seconds=$(field demo/lhs.json seconds)
show octrad render $scene --integrator path --spp 100000 --time "${seconds}s" "${size[@]}" --seed 2 -o demo/path.exr --json >demo/path.json

step "Errors"
show octrad compare demo/ref.exr demo/lhs.exr
octrad compare demo/ref.exr demo/lhs.exr --json -q >demo/error_lhs.json
octrad compare demo/ref.exr demo/path.exr --json -q >demo/error_path.json
octrad compare demo/ref.exr demo/noise.exr --json -q >demo/error_noise.json
octrad compare demo/ref.exr demo/lhs.exr --alpha-below 0.5 --json -q >demo/glossy_lhs.json
octrad compare demo/ref.exr demo/path.exr --alpha-below 0.5 --json -q >demo/glossy_path.json
for name in ref lhs path; do octrad tonemap -q demo/$name.exr -o demo/$name.png --exposure 0.3; done

# The difference of two independent pictures holds the noise of both; its share goes with 1 / samples.
own=$(awk -v e="$(field demo/error_noise.json mape)" -v a="$(field demo/ref.json spp)" -v b="$(field demo/noise.json spp)" \
  'BEGIN { printf "%.3f", e / sqrt(1 + a / b) }')
row() { printf '  %-34s %8.3f s  %6d spp   MAPE %7.3f   glossy surfaces %7.3f   mean %6.3f\n' "$@"; }
printf '\n'
table() {  # table NAME TITLE
  row "$2" "$(field "demo/$1.json" seconds)" "$(field "demo/$1.json" spp)" "$(field "demo/error_$1.json" mape)" \
    "$(field "demo/glossy_$1.json" mape)" "$(field "demo/error_$1.json" mean_ratio)"
}
table lhs "radiance cache (lhs)"
table path "path tracing, same time as lhs"
printf '  The reference has %s spp; its own noise is a MAPE of about %s.\n' "$(field demo/ref.json spp)" "$own"
printf '\nPictures:\n'
printf '  %s\n' "$PWD/demo/ref.png   reference" "$PWD/demo/lhs.png   radiance cache" \
  "$PWD/demo/path.png  path tracing in the same time"
printf '\nDone in %d min %d s.\n' $(((SECONDS - started) / 60)) $(((SECONDS - started) % 60))
printf 'Walk through it in a browser:\n  %s/octrad view %s --model demo/room.octrad --train --open\n' "$build" $scene
