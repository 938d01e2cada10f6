#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Makes what packages are linked with, in build/package: sources from a Debian mirror, static libraries of them, and
# stubs of glibc 2.28. What is made stays for the next run.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
parts=$PWD/build/package
jobs=${STIPPLE_JOBS:-$(bash native/build_jobs.sh)}
python=/usr/bin/python3

$python native/package/fetch.py "$parts"
$python native/package/glibc_stubs.py "$parts"
cmake -S native/package/parts -B "$parts/parts" -G Ninja -DCMAKE_BUILD_TYPE=Release \
  -DSTIPPLE_SOURCES="$parts/source" >/dev/null
cmake --build "$parts/parts" --parallel "$jobs"
