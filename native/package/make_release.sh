#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Makes the zip of the add-on that runs on every Linux of x86-64 with glibc 2.28 or newer:
# build/stipple-VERSION-linux_x64.zip.
#   bash native/package/make_release.sh             makes it and looks at it
#   bash native/package/make_release.sh --twice     makes it again from a copy of the sources in another folder, without
#                                                   a compiler's cache, and compares the bytes
# Takes Debian 12. STIPPLE_JOBS: compilers at a time.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
python=/usr/bin/python3
parts=$PWD/build/package

make_zip() { # FOLDER of the sources, its name without extension
  cmake -S "$1" --preset portable -DSTIPPLE_PACKAGE_PARTS="$parts" >/dev/null
  cmake --build "$1/build/portable" --parallel "$jobs"
  $python native/package/licences.py "$parts" "$1/build/licences"
  $python "$1/addon/make_zip.py" --libraries "$1/build/portable/lib" --licences "$1/build/licences" --self-contained \
    --output "$1/build/$name"
}

bash native/install_dependencies.sh --package
jobs=${STIPPLE_JOBS:-$(bash native/build_jobs.sh)}
name=$($python -c 'import sys; sys.path.insert(0, "addon"); import make_zip; print(make_zip.split_name())')
bash native/package/make_parts.sh
make_zip "$PWD"
zip=build/$name
ls -l build/portable/lib
STIPPLE_ZIP=$PWD/$zip $python -m pytest -q -rs -p no:cacheprovider tests/package

if [ "${1:-}" = --twice ]; then
  copy=build/second
  rm -rf "$copy"
  mkdir -p "$copy"
  git ls-files -z | xargs -0 cp --parents -t "$copy"
  CCACHE_DISABLE=1 make_zip "$PWD/$copy"
  cmp "$zip" "$copy/build/$name"
  echo "Made twice, with the same bytes: $(sha256sum < "$zip" | cut -c 1-64)"
fi
if blender=$(command -v blender) && "$blender" --version | grep -qE '^Blender (4\.[2-9]|[5-9])'; then
  "$blender" --command extension validate "$zip"
else
  echo "Not looked at by Blender itself: extensions exist from Blender 4.2 on (tests/run_blender_matrix.sh has it)."
fi
