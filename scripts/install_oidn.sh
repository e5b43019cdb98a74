#!/usr/bin/env bash
# Installs the libraries of Intel Open Image Denoise 2 (Apache 2.0) where octrad looks for them; they are taken from
# PyPI's package pyoidn, of which nothing else is kept.
#   scripts/install_oidn.sh [FOLDER]    default: ~/.local/lib/octrad; for another one say --oidn-library FOLDER
set -euo pipefail

case "${1:-}" in
  -*) echo "usage: scripts/install_oidn.sh [FOLDER]" >&2; exit 1 ;;
esac
folder=${1:-$HOME/.local/lib/octrad}

python=
for candidate in python3 /usr/bin/python3; do
  if "$candidate" -m pip --version >/dev/null 2>&1; then python=$candidate; break; fi
done
if [ -z "$python" ]; then
  echo "python3 with pip is needed (Debian: apt-get install python3-pip)." >&2
  exit 1
fi

mkdir -p "$folder"
scratch=$(mktemp -d "$folder/.install-XXXXXX") # on the same disk, so that each file is moved as a whole
trap 'rm -rf "$scratch"' EXIT
"$python" -m pip download --quiet --disable-pip-version-check --no-deps --only-binary=:all: --dest "$scratch" 'pyoidn>=2,<3'
"$python" -m zipfile -e "$scratch"/pyoidn-*.whl "$scratch/wheel"

libraries=$scratch/wheel/pyoidn/oidn/lib
for needed in "$libraries"/libOpenImageDenoise.so.2 "$libraries"/libOpenImageDenoise_device_cpu.so.2.*; do
  if [ ! -f "$needed" ]; then
    echo "pyoidn does not hold $(basename "$needed"): this package is built otherwise." >&2
    exit 1
  fi
done
# The library that programs load comes last: an interrupted installation leaves none, or a complete one.
for file in "$libraries"/libOpenImageDenoise_{core,device_cpu,device_cuda}.so.2.* "$libraries"/libtbb.so.12 "$libraries"/libOpenImageDenoise.so.2; do
  [ ! -f "$file" ] || mv -f "$file" "$folder/"
done
echo "Open Image Denoise is in $folder"
