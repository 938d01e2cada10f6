#!/usr/bin/env bash
# A Debian suite in a folder, with that suite's Blender: bookworm has 3.4, trixie 4.3, sid 5.2. Needs root.
#   blender_suite.sh prepare SUITE DIR        makes it, or brings an unfinished one to its end (some minutes, 2.5 GB)
#   blender_suite.sh prepare SUITE DIR bare   with Blender and what tests in it take, and nothing that a build takes
#   blender_suite.sh run DIR COMMAND...       runs COMMAND inside, with the current folder at /project
# Mounts live in a namespace of their own and end with the command, so that DIR can be removed like any other folder.
set -euo pipefail

# What Debian's Blender 4.3 and 5.2 ask for when they start, beside the packages that Stipple names.
extra_packages=(python3-cattr python3-requests xvfb xauth)
# Of what Stipple names, all that a suite has that is to run a zip as an artist's machine does.
bare_packages=(blender libegl1 libegl-mesa0 libgl1-mesa-dri python3-numpy python3-pytest)

fail() {
  echo "blender_suite.sh: $1" >&2
  exit 1
}

inside() { # DIR COMMAND...: /proc, /dev and the project are there while the command runs
  local dir=$1
  shift
  mkdir -p "$dir/project"
  ln -sfn /proc/self/mounts "$dir/etc/mtab"
  unshare --mount sh -c '
    dir=$1 && shift
    for folder in proc sys dev; do mount --rbind "/$folder" "$dir/$folder" || exit 1; done
    mount -t tmpfs tmpfs "$dir/dev/shm" && mount --bind "$PWD" "$dir/project" || exit 1
    exec chroot "$dir" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 \
      STIPPLE_JOBS="${STIPPLE_JOBS:-}" sh -c '\''cd /project && exec "$@"'\'' sh "$@"' sh "$dir" "$@"
}

prepare() { # SUITE DIR ['bare']
  local suite=$1 dir=$2 kind=${3:-} mirror
  if [[ -e $dir/stipple-suite && $(cat "$dir/stipple-suite") == "$suite${kind:+ $kind}" ]]; then
    return
  fi
  command -v debootstrap >/dev/null || DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends debootstrap
  mirror=$(sed -n 's/^URIs: *//p' /etc/apt/sources.list.d/debian.sources 2>/dev/null | head -1)
  if [[ ! -e $dir/usr/bin/apt-get || -d $dir/debootstrap ]]; then
    rm -rf --one-file-system "$dir"
    mkdir -p "$dir"
    debootstrap --variant=minbase "$suite" "$dir" "${mirror:-http://deb.debian.org/debian}"
  fi
  cp /etc/resolv.conf /etc/hosts "$dir/etc/"
  # Packages must not start services here.
  printf '#!/bin/sh\nexit 101\n' > "$dir/usr/sbin/policy-rc.d"
  chmod +x "$dir/usr/sbin/policy-rc.d"
  if [[ $kind == bare ]]; then
    extra_packages+=("${bare_packages[@]}")
  else
    inside "$dir" bash native/install_dependencies.sh
  fi
  local install=(env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${extra_packages[@]}")
  # The lists that debootstrap left may name files that are gone.
  inside "$dir" "${install[@]}" || { inside "$dir" apt-get update && inside "$dir" "${install[@]}"; }
  inside "$dir" apt-get clean
  echo "$suite${kind:+ $kind}" > "$dir/stipple-suite"
}

[[ $(id -u) == 0 ]] || fail "this takes root, for chroot and mounts."
case ${1:-} in
  prepare)
    [[ ($# == 3 || ($# == 4 && $4 == bare)) && $2 =~ ^(bookworm|trixie|sid)$ ]] ||
      fail "usage: prepare bookworm|trixie|sid DIR [bare]."
    dir=$(realpath -m "$3")
    cd "$(dirname "${BASH_SOURCE[0]}")/.."
    prepare "$2" "$dir" "${4:-}"
    ;;
  run)
    [[ $# -ge 3 ]] || fail "usage: run DIR COMMAND..."
    [[ -e $2/stipple-suite ]] || fail "'$2' is not a prepared suite; make it with: blender_suite.sh prepare SUITE $2"
    inside "$(realpath "$2")" "${@:3}"
    ;;
  *) fail "the verb is '${1:-}'; it must be prepare or run." ;;
esac
