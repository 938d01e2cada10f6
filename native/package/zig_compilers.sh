#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Writes the compilers cc and c++ for a toolchain that includes zig.cmake.
#   bash native/package/zig_compilers.sh ZIG TOOLCHAIN OUTPUT
# What is compiled goes to the clang inside zig with the words that zig itself would give it, which it is asked for once
# here: zig's own way adds a copy of every object and knows no precompiled headers. What is linked goes to zig.
set -euo pipefail
zig=$1 toolchain=$2 output=$3
value() { sed -n "s/^set($1 \\(.*\\))\$/\\1/p" "$toolchain"; }
target=(-target "$(value STIPPLE_ZIG_TARGET)" -mcpu="$(value STIPPLE_ZIG_CPU)")
mkdir -p "$output"
output=$(cd "$output" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"  # names of zig's own folders are whole ones from there

write() { # NAME EXTENSION: how zig calls its clang for a file of this kind, without the files and what they are named by
  local source=$folder/empty.$2 words word skip=
  echo "int empty$RANDOM$RANDOM;" >"$source"  # which zig has not compiled before
  words=$(ZIG_VERBOSE_CC=1 "$zig" "$1" "${target[@]}" -s -O2 -fno-sanitize=undefined -c "$source" -o "$source.o" 2>&1 |
    grep " clang $source " | tail -1)
  local -a kept=()
  for word in $words; do
    if [ -n "$skip" ]; then
      skip=
      continue
    fi
    case $word in
      "$zig" | clang | "$source" | -c | -MD | -MV) ;;
      -o | -MF | -MT) skip=yes ;;
      *) kept+=("$word") ;;
    esac
  done
  [ ${#kept[@]} -gt 10 ] || { echo "zig_compilers.sh: zig does not say how it compiles: '$words'" >&2; exit 1; }
  {
    echo '#!/bin/sh'
    # A compiler's cache looks at this file to tell one compiler from another.
    echo "# zig $("$zig" version)"
    echo 'case " $* " in'
    printf '  *" -c "* | *" -E "*) exec %q clang' "$zig"
    printf ' %q' "${kept[@]}"
    # A precompiled header out of a compiler's cache is as good as the one that was made with these files.
    printf ' -Xclang -fno-pch-timestamp "$@" ;;\n'
    echo 'esac'
    printf 'exec %q %s' "$zig" "$1"
    printf ' %q' "${target[@]}"
    echo ' -s "$@"'
  } >"$output/$1"
  chmod +x "$output/$1"
}
write cc c
write c++ cpp
