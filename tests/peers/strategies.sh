#!/usr/bin/env bash
# Fits four sets of pictures with every strategy of density control and writes the table and the plot of the docs.
#   bash tests/peers/strategies.sh [--seeds 3] [--iterations 3000] [--strategies a,b] [--scenes a,b] [--photos FOLDER]
# Blender renders the pictures (make_photos.py). Fits that are done are kept in build/peers/strategies/results.jsonl and not done
# again, so that a night's work may be cut off and goes on. Time is that of the processors, so that
# other work on the machine changes it little.
# STIPPLE_BUILD_DIR: as fit.sh. STIPPLE_STRATEGIES_DIR: instead of build/peers/strategies. Exit 77: something is missing, and which.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
stipple=${STIPPLE_BUILD_DIR:-$root/build/release}/bin/stipple
folder=${STIPPLE_STRATEGIES_DIR:-$root/build/peers/strategies}

missing() {
  echo "strategies.sh: $1" >&2
  exit 77
}
[[ -x $stipple ]] || missing "$stipple is not built; cmake --build build/release --target stipple_tool stipple_media"
command -v blender > /dev/null || missing "blender is not installed"
mkdir -p "$folder"
for scene in fine_texture thin_structures furnished_room still_life; do
  [[ -f $folder/$scene/transforms.json ]] && continue
  echo "Rendering $scene into $folder"
  blender -b --factory-startup -P "$root/tests/peers/make_photos.py" -- "$folder/$scene" --scene "$scene" \
    > "$folder/$scene.log" 2>&1 || missing "pictures could not be rendered; the end of $folder/$scene.log says why"
done
exec /usr/bin/python3 "$root/tests/peers/compare_strategies.py" "$stipple" "$folder" "$root/docs" "$@"
