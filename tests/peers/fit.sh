#!/usr/bin/env bash
# Fits a photo set with OpenSplat and with `stipple fit`, for as many iterations, and compares time and held-out PSNR.
#   OPENSPLAT_SOURCE=folder bash tests/peers/fit.sh [DATASET]
# DATASET: a folder with transforms.json; without it a set of 57 pictures is rendered by Blender (make_photos.py).
# STIPPLE_BUILD_DIR, OPENSPLAT_BUILD_DIR: as opensplat.sh. Exit 77: something is missing, and which.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/build_opensplat.sh"
stipple=$build/bin/stipple
[[ -x $stipple ]] || missing "$stipple is not built; cmake --build $build --target stipple_tool stipple_media"
build_opensplat

photos=${1:-$root/build/peers/photos}
if [[ $# -eq 0 && ! -f $photos/transforms.json ]]; then
  command -v blender > /dev/null || missing "blender is not installed; name a data set"
  echo "Rendering pictures into $photos"
  blender -b --factory-startup -P "$root/tests/peers/make_photos.py" -- "$photos" > "$photos.log" 2>&1 ||
    missing "the pictures could not be rendered; the end of $photos.log says why"
fi
exec /usr/bin/python3 "$root/tests/peers/compare_fits.py" "$peer_build/opensplat" "$stipple" "$photos"
