#!/usr/bin/env bash
# Brings a file of splats down to 50, 25, 10 and 5 % with splat-transform's two rules and with ours, and prints
# times and PSNR of 16 views against the full cloud. See README.md here.
#   bash tests/peers/reduce.sh [FILE | room]
# room: a furnished room that make_room.py builds, as 150,000 splats, looked at from inside.
# SPLAT_TRANSFORM: its command (default node_modules/.bin/splat-transform in build/peers/npm, installed where npm
# is there). PYTHON: one with numpy (default /usr/bin/python3). STIPPLE_BUILD_DIR: our build (default build/release). Exit 77: something is missing, and which.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=${STIPPLE_BUILD_DIR:-$root/build/release}
npm_folder=$root/build/peers/npm
work=$root/build/peers/reduce
program=$build/tests/reduction_pictures
file=${1:-${STIPPLE_REDUCE_FILE:-}}
version=3.7.0
tool=$build/bin/stipple
views=0

missing() {
  echo "reduce.sh: $1" >&2
  exit 77
}

mkdir -p "$work"
[[ -x $program && -x $tool ]] \
  || missing "$program or $tool is not built; cmake --build $build --target reduction_pictures stipple_tool stipple_media"
if [[ $file == room ]]; then
  views=2
  file=$work/room.ply
  "${PYTHON:-/usr/bin/python3}" "$root/tests/peers/make_room.py" "$work/room.glb" || missing "make_room.py failed (it needs numpy)."
  "$tool" decode "$work/room.glb" "$file" --anchors 150000 >/dev/null
fi
[[ -n $file && -f $file ]] || missing "'$file' is no file of splats; give one as the argument."
peer=${SPLAT_TRANSFORM:-$npm_folder/node_modules/.bin/splat-transform}
if [[ ! -x $peer ]]; then
  command -v npm >/dev/null || missing "npm is missing; splat-transform comes through it (apt-get install npm)."
  mkdir -p "$npm_folder"
  (cd "$npm_folder" && npm install --no-audit --no-fund "@playcanvas/splat-transform@$version") >"$npm_folder/log" 2>&1 \
    || missing "splat-transform $version could not be installed; $npm_folder/log says why."
fi

# Both read the same float32 numbers.
"$tool" convert "$file" "$work/full.ply" >/dev/null || missing "$file cannot be read."
count=$("$program" --count "$work/full.ply")
arguments=()
for percent in 50 25 10 5; do
  budget=$((count * percent / 100))
  for rule in decimate decimate-adaptive; do
    out=$work/$rule-$percent.ply
    start=$(date +%s.%N)
    # -g cpu: without a graphics processor it takes its own path for the processor.
    "$peer" -g cpu -q -w "$work/full.ply" "--$rule" "$budget" "$out" >/dev/null 2>&1 \
      || missing "splat-transform failed with --$rule $budget."
    seconds=$(echo "$(date +%s.%N) $start" | awk '{print $1 - $2}')
    arguments+=("$budget" "$rule" "$seconds" "$out")
  done
done
exec "$program" "$work/full.ply" "$views" "${arguments[@]}"
