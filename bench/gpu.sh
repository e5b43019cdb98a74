#!/bin/sh
# Evidence from a GPU, from a clone or a bundle: a plan's steps, the most important first, the results written after every one.
#   bench/gpu.sh --plan first --budget 480 --require-gpu -o first.json        does it work, and where does the time go
#   bench/gpu.sh --plan second --budget 420 --require-gpu -o second.json      why, and which variant
#   bench/gpu.sh --plan third --require-gpu [SCENE.xml]                       the record: bench/results/<date>-<gpu>.json
# Options: --help. Without a GPU it says so, or ends (--require-gpu).
set -eu
exec python3 "$(dirname "$0")/gpu.py" "$@"
