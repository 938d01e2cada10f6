#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Makes what packages are linked with: sources from a Debian mirror, static libraries of them, and for Linux stubs of
# glibc 2.28. What is made stays for the next run.
#   bash native/package/make_parts.sh             for Linux, in build/package
#   bash native/package/make_parts.sh --windows   for Windows by mingw-w64, in build/package/windows
#   bash native/package/make_parts.sh --macos-arm64, --macos-x64 or --linux-arm64
#                                                 by zig, in build/package/macos_arm64 and so on
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
folder=$PWD/build/package
jobs=${STIPPLE_JOBS:-$(bash native/build_jobs.sh)}
python=/usr/bin/python3
parts=$folder
cross=() zig=() kind=
case ${1:-} in
  '') ;;
  --windows) kind=windows ;;
  --macos-arm64 | --macos-x64 | --linux-arm64) kind=${1#--} kind=${kind/-/_} zig=(--zig) ;;
  *) echo "make_parts.sh: the option '$1' is none of --windows, --macos-arm64, --macos-x64 and --linux-arm64." >&2
     exit 1 ;;
esac
if [ -n "$kind" ]; then
  parts=$folder/$kind
  cross=(-DCMAKE_TOOLCHAIN_FILE="$PWD/native/package/$kind.cmake")
fi

# The mirror that this machine's packages come from.
mirror=$(sed -n 's/^URIs: *//p' /etc/apt/sources.list.d/debian.sources 2>/dev/null | head -1)
$python native/package/fetch.py "$folder" --mirror "${mirror:-http://deb.debian.org/debian}" "${zig[@]}"
if [ ${#cross[@]} -eq 0 ]; then
  $python native/package/glibc_stubs.py "$parts"
fi
if [ ${#zig[@]} -gt 0 ]; then
  bash native/package/zig_compilers.sh "$folder/zig/zig" "native/package/$kind.cmake" "$parts/bin"
fi
cmake -S native/package/parts -B "$parts/parts" -G Ninja -DCMAKE_BUILD_TYPE=Release "${cross[@]}" \
  -DSTIPPLE_SOURCES="$folder/source" -DSTIPPLE_PARTS="$parts" >/dev/null
cmake --build "$parts/parts" --parallel "$jobs"

# own_build NAME OPTION...: libraries that only their own build can make.
own_build() {
  local name=$1
  shift
  if [ ! -e "$parts/$name/made" ]; then
    # Flags come by the environment, so that those of the toolchain are added to them.
    CFLAGS="-fexceptions $maps" CXXFLAGS=$maps cmake -S "$folder/source/$name" -B "$parts/$name" -G Ninja \
      -DCMAKE_BUILD_TYPE=Release "${cross[@]}" -DBUILD_SHARED_LIBS=OFF -DBUILD_TESTING=OFF \
      -DCMAKE_POSITION_INDEPENDENT_CODE=ON -DCMAKE_INSTALL_PREFIX="$parts" -DCMAKE_INSTALL_LIBDIR="$parts/lib" \
      -DCMAKE_PREFIX_PATH="$parts" -DZLIB_INCLUDE_DIR="$folder/source/zlib" -DZLIB_LIBRARY="$parts/lib/libz.a" \
      "${launcher[@]}" "$@" >"$parts/$name.log"
    cmake --build "$parts/$name" --parallel "$jobs" --target install >>"$parts/$name.log"
    touch "$parts/$name/made"
  fi
}
maps="-ffile-prefix-map=$folder=parts"
launcher=()
if command -v ccache >/dev/null; then
  launcher=(-DCMAKE_C_COMPILER_LAUNCHER=ccache -DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
fi
simd=ON
# zig's linker, which links the programs that come with libjpeg, knows no absolute symbols, which nasm writes.
[[ $kind == macos_x64 ]] && simd=OFF
# nasm writes the time and the folder into objects for Windows unless it is told not to.
own_build jpeg -DENABLE_SHARED=OFF -DWITH_TURBOJPEG=OFF -DWITH_SIMD=$simd -DREQUIRE_SIMD=$simd \
  -DCMAKE_ASM_NASM_FLAGS=--reproducible
own_build imath -DIMATH_INSTALL_PKG_CONFIG=OFF
own_build openexr -DOPENEXR_BUILD_TOOLS=OFF -DOPENEXR_INSTALL_EXAMPLES=OFF -DOPENEXR_INSTALL_PKG_CONFIG=OFF \
  -DOPENEXR_INSTALL_TOOLS=OFF

if ((${#zig[@]})); then
  # What zig links into every program: it says where it keeps it, unless it has linked the same before.
  echo "int main() { throw $RANDOM$RANDOM; }" >"$parts/empty.cpp"
  linked=$(ZIG_VERBOSE_LINK=1 "$parts/bin/c++" -O2 "$parts/empty.cpp" -o "$parts/empty" 2>&1)
fi
linked_in() { # NAME
  tr ' ' '\n' <<<"$linked" | grep "/$1\$" | tail -1
}
if [[ $kind == macos_* ]]; then
  # For LLVM's linker. zig's own functions for the compiler stay away: macOS has those that are needed, and with them
  # would come exp, memcpy and others that macOS has, too, and which round otherwise.
  for name in libc++.a libc++abi.a; do
    cp "$(linked_in $name)" "$parts/lib/$name"
  done
  cp "$folder/zig/lib/libc/darwin/libSystem.11.tbd" "$parts/lib/libSystem.tbd"
elif [[ $kind == linux_arm64 ]]; then
  # The compiler's own functions are one object, which brings exp, memcpy and some 80 more that the C library has, too,
  # and which round otherwise. Here these have no names, so that those of the C library are called.
  llvm-nm --defined-only "$(linked_in libcompiler_rt.a)" | awk '$2 == "W" && $3 !~ /^__/ { print $3 }' >"$parts/names"
  llvm-objcopy --localize-symbols="$parts/names" "$(linked_in libcompiler_rt.a)" "$parts/lib/libcompiler_rt.a"
fi
