#!/usr/bin/env bash
# Installs the Debian packages that octrad needs and that are missing. Nothing is touched when all are there.
#   scripts/install_deps.sh          what building and running needs
#   scripts/install_deps.sh --test   also what the tests need
set -euo pipefail

packages=(
  g++ cmake ninja-build ccache
  libembree-dev libtbb-dev libopenexr-dev libstb-dev libpugixml-dev libcli11-dev libfmt-dev nlohmann-json3-dev libhwy-dev
)
case "${1:-}" in
  "") ;;
  --test) packages+=(libgtest-dev pkg-config python3 python3-numpy clang clang-format clang-tidy chromium) ;;
  *) echo "usage: scripts/install_deps.sh [--test]" >&2; exit 1 ;;
esac

if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
  echo "This is not a Debian system, so nothing is installed here. octrad needs (Debian's names):" >&2
  printf '  %s\n' "${packages[@]}" >&2
  exit 0
fi

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$status" = installed ] || missing+=("$package")
done
[ ${#missing[@]} -gt 0 ] || exit 0

as_root=()
if [ "$(id -u)" != 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "Missing packages, and neither root nor sudo to install them. As root, run:" >&2
    echo "  apt-get update && apt-get install --no-install-recommends ${missing[*]}" >&2
    exit 1
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

echo "Installing: ${missing[*]}"
apt_get update
apt_get install -y --no-install-recommends "${missing[@]}"
