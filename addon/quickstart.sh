#!/usr/bin/env bash
# From nothing to splats: installs what is missing, builds the library, opens a scene in background
# Blender, turns its mesh into splats at three budgets, and leaves pictures, a point cloud and a volume
# in build/quickstart. Safe to run again.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=$PWD/build/quickstart

echo "1/4  Dependencies"
bash native/install_dependencies.sh
echo "2/4  Building the library and the tool"
cmake --preset release >/dev/null
cmake --build build/release --parallel "${STIPPLE_JOBS:-$(bash native/build_jobs.sh)}" \
  --target stipple stipple_media stipple_tool
echo "3/4  Packing the add-on"
mkdir -p "$out"
/usr/bin/python3 addon/make_zip.py --output "$out/stipple.zip"
rm -rf "$out/scripts"
/usr/bin/python3 -m zipfile -e "$out/stipple.zip" "$out/scripts/addons"
echo "4/4  Mesh, splats, volume in Blender"
cp blend-fixtures/suzanne.blend "$out/suzanne.blend"
# Debian's Blender asks the first python3 in PATH where its modules are: let that be the system's.
PATH=/usr/bin:$PATH BLENDER_USER_SCRIPTS=$out/scripts blender -b --factory-startup --addons stipple --python-exit-code 1 \
  --python addon/quickstart.py -- "$out" build/release/bin/stipple
oiiotool build/quickstart/{mesh,splats_2000,splats_10000,splats_50000,volume}.png --mosaic 5x1 \
  --resize 1600x240 --create 1600x240 4 --addc 1,1,1,1 --over --ch R,G,B -o build/quickstart/overview.png
echo "Mesh, three budgets and the volume, side by side: build/quickstart/overview.png"
