#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Makes the zip of the add-on that runs on every machine of a kind, build/stipple-VERSION-PLATFORM.zip: linux_x64, for
# every Linux of x86-64 with glibc 2.28 or newer, windows_x64, macos_arm64, macos_x64 or linux_arm64.
#   bash native/package/make_release.sh             makes the one for Linux and looks at it
#   bash native/package/make_release.sh --windows   makes the one for Windows, and runs it by Wine where that is
#   bash native/package/make_release.sh --macos-arm64, --macos-x64 or --linux-arm64
#                                                   makes the one for these and looks at it; qemu runs that of Linux
#   bash native/package/make_release.sh --twice     after any: makes it again from a copy of the sources in another
#                                                   folder, with all that is linked in and without a compiler's cache,
#                                                   and compares the bytes
# Takes Debian 12. STIPPLE_JOBS: compilers at a time.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
python=/usr/bin/python3
folder=build/package
parts=$folder preset=portable libraries=lib platform=linux-x64 dependencies=--package
parts_option=() targets=(all) twice=
for option; do
  case $option in
    --windows)
      parts=$folder/windows preset=windows libraries=bin platform=windows-x64 dependencies=--windows
      parts_option=(--windows) targets=(stipple stipple_tool)
      ;;
    --macos-arm64 | --macos-x64 | --linux-arm64)
      platform=${option#--} preset=${platform/-/_} parts=$folder/$preset dependencies=--zig
      parts_option=("$option") targets=(stipple stipple_tool)
      ;;
    --twice) twice=yes ;;
    *) echo "make_release.sh: the option is '$option'; --windows, --macos-arm64, --macos-x64, --linux-arm64 and" \
            "--twice are known." >&2
       exit 1 ;;
  esac
done

make_zip() { # FOLDER of the sources
  bash "$1/native/package/make_parts.sh" "${parts_option[@]}"
  cmake -S "$1" --preset $preset -DSTIPPLE_PACKAGE_PARTS="$1/$parts" >/dev/null
  cmake --build "$1/build/$preset" --parallel "$jobs" --target "${targets[@]}"
  $python "$1/native/package/licences.py" "$1/$folder" "$1/build/licences" --platform $platform
  $python "$1/addon/make_zip.py" --libraries "$1/build/$preset/$libraries" --licences "$1/build/licences" \
    --self-contained --platform $platform --output "$1/build/$name"
}

if [ $dependencies = --zig ]; then
  # What a compiler's cache has to know of it: its kind, which the script does not tell, that what is precompiled is
  # content like any other, and that the compiler says itself what it has read, so that no file is read twice.
  export CCACHE_COMPILERTYPE=clang CCACHE_COMPILERCHECK=content CCACHE_DEPEND=1
  export CCACHE_SLOPPINESS=pch_defines,time_macros
fi
bash native/install_dependencies.sh $dependencies
jobs=${STIPPLE_JOBS:-$(bash native/build_jobs.sh)}
name=$($python -c "import sys; sys.path.insert(0, 'addon'); import make_zip; print(make_zip.split_name('$platform'))")
make_zip "$PWD"
zip=build/$name
ls -l "build/$preset/$libraries"
tests=(tests/package) variable=STIPPLE_ZIP
case $platform in
  windows-x64) tests=(tests/package/test_windows{,_tool}.py) variable=STIPPLE_WINDOWS_ZIP ;;
  macos-*) tests=(tests/package/test_macos.py) variable=STIPPLE_MACOS_ZIP ;;
  linux-arm64) tests=(tests/package/test_linux_arm64.py) variable=STIPPLE_ARM_ZIP ;;
esac
env "$variable=$PWD/$zip" $python -m pytest -q -rs -p no:cacheprovider "${tests[@]}"

if [ -n "$twice" ]; then
  # Only what was fetched is handed over.
  copy=$PWD/build/second
  rm -rf "$copy"
  mkdir -p "$copy/$folder"
  git ls-files -z | xargs -0 cp --parents -t "$copy"
  cp -r $folder/downloads "$copy/$folder"
  CCACHE_DISABLE=1 ZIG_GLOBAL_CACHE_DIR=$copy/build/zig-cache make_zip "$copy"
  cmp "$zip" "$copy/build/$name"
  echo "Made twice, with the same bytes: $(sha256sum < "$zip" | cut -c 1-64)"
fi
if blender=$(command -v blender) && "$blender" --version | grep -qE '^Blender (4\.[2-9]|[5-9])'; then
  "$blender" --command extension validate "$zip"
else
  echo "Not looked at by Blender itself: extensions exist from Blender 4.2 on (tests/run_blender_matrix.sh has it)."
fi
