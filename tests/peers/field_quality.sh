#!/usr/bin/env bash
# How good fields are at every budget, with and without the density gradient and jitter, beside explicit splats and
# their cuts: three objects (make_objects.py) by as many seeds. See README.md here.
#   bash tests/peers/field_quality.sh
# ITERATIONS (300), SEEDS (3), LEAST (64) and MOST (1024) anchors, GAUSSIANS (4) per anchor, DOWNSCALE (2) of 160 x 160.
# For less than all of it: ARMS (all, parted by commas), OBJECTS (head cage heap).
# STIPPLE_BUILD_DIR: our build (default build/release). Exit 77: something is missing, and which.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=${STIPPLE_BUILD_DIR:-$root/build/release}
objects=$root/build/peers/objects
program=$build/tests/field_quality

missing() {
  echo "field_quality.sh: $1" >&2
  exit 77
}

[[ -x $program ]] || missing "$program is not built; cmake --build $build --target field_quality stipple_media"
if [[ ! -f $objects/heap/transforms.json ]]; then
  command -v blender >/dev/null || missing "blender is not installed; it renders the objects."
  mkdir -p "$objects"
  blender -b --factory-startup -P "$root/tests/peers/make_objects.py" -- "$objects" >"$objects/log" 2>&1 \
    || missing "the objects could not be rendered; the end of $objects/log says why."
fi
read -r -a names <<<"${OBJECTS:-head cage heap}"
exec "$program" "${ITERATIONS:-300}" "${SEEDS:-3}" "${LEAST:-64}" "${MOST:-1024}" "${GAUSSIANS:-4}" "${DOWNSCALE:-2}" \
  "${ARMS:-field,gradient off,jitter off,explicit cut}" "${names[@]/#/$objects/}"
