#!/usr/bin/env bash
# Installs the Debian packages that octrad needs and that are missing. Nothing is touched when all are there.
#   scripts/install_deps.sh          what building and running needs
#   scripts/install_deps.sh --test   also what the tests need
set -euo pipefail

packages=(
  g++ cmake ninja-build ccache
  libembree-dev libtbb-dev libopenexr-dev libpng-dev libjpeg-dev libwebp-dev libpugixml-dev zlib1g-dev libmeshoptimizer-dev libcli11-dev libboost-dev libfmt-dev nlohmann-json3-dev libhwy-dev
)
optional=()  # what is tested with these is skipped without them
case "${1:-}" in
  "") ;;
  --test) packages+=(libgtest-dev pkg-config python3 python3-numpy clang clang-format clang-tidy)
    optional=(chromium) ;;
  *) echo "usage: scripts/install_deps.sh [--test]" >&2; exit 1 ;;
esac

if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
  echo "This is not a Debian system, so nothing is installed here. octrad needs (Debian's names):" >&2
  printf '  %s\n' "${packages[@]}" "${optional[@]}" >&2
  exit 0
fi

is_installed() { [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null || true)" = installed ]; }
missing=() wanted=()
for package in "${packages[@]}"; do is_installed "$package" || missing+=("$package"); done
for package in "${optional[@]}"; do is_installed "$package" || wanted+=("$package"); done
[ ${#missing[@]} -gt 0 ] || [ ${#wanted[@]} -gt 0 ] || exit 0

# Ends the script: as a failure only where something is missing that cannot be done without.
give_up() {
  [ ${#missing[@]} -eq 0 ] || exit 1
  echo "Not installed, tests that need it are skipped: ${wanted[*]}"
  exit 0
}

as_root=()
if [ "$(id -u)" != 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "Missing packages, and neither root nor sudo to install them. As root, run:" >&2
    echo "  apt-get update && apt-get install --no-install-recommends ${missing[*]} ${wanted[*]}" >&2
    give_up
  fi
  as_root=(sudo)
fi

# Runs apt-get. While another package run holds a lock, tries again every 5 seconds, for 10 minutes at most. (The option
# DPkg::Lock::Timeout waits for dpkg's lock only, not for the ones of the package lists and of the archives.)
apt_get() {
  local log waited=0
  log=$(mktemp)
  until "${as_root[@]}" env LC_ALL=C DEBIAN_FRONTEND=noninteractive apt-get -qq "$@" >"$log" 2>&1; do
    if ! grep -q "Could not get lock" "$log" || [ $waited -ge 600 ]; then
      cat "$log" >&2
      rm -f "$log"
      return 1
    fi
    [ $waited -gt 0 ] || echo "Another package run holds a lock; waiting for it, 10 minutes at most."
    sleep 5
    waited=$((waited + 5))
  done
  rm -f "$log"
}

echo "Installing: ${missing[*]} ${wanted[*]}"
apt_get update || give_up
if [ ${#missing[@]} -gt 0 ]; then apt_get install -y --no-install-recommends "${missing[@]}"; fi
for package in "${wanted[@]}"; do
  apt_get install -y --no-install-recommends "$package" || echo "Not installed, tests that need it are skipped: $package"
done
