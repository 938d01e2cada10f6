#!/usr/bin/env bash
# Runs the fuzzer of every reader of splat files for so many seconds each (default 60), from a corpus of
# small valid files. Needs clang with libFuzzer (Debian: clang libclang-rt-dev), and says so where it is missing.
#   bash tests/fuzz/run.sh [SECONDS] [FORMAT...]
# What a fuzzer finds lies in build/fuzz/found, named after its format.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

seconds=${1:-60}
shift || true
if ! command -v clang++ >/dev/null ||
    ! echo 'extern "C" int LLVMFuzzerTestOneInput(const unsigned char*, unsigned long) { return 0; }' |
      clang++ -x c++ -fsanitize=fuzzer,address - -o /dev/null 2>/dev/null; then
  echo "Fuzzing is skipped: clang++ with libFuzzer is not installed (Debian: clang libclang-rt-dev)."
  exit 0
fi
jobs=${STIPPLE_JOBS:-$(bash native/build_jobs.sh)}
cmake --preset fuzz
cmake --build build/fuzz --target fuzzers --parallel "$jobs"
# The packing libraries come through libstipple_media, which the plain build makes.
cmake --preset release
cmake --build build/release --target stipple_media --parallel "$jobs"
mkdir -p build/fuzz/lib build/fuzz/found
ln -sf ../../release/lib/libstipple_media.so build/fuzz/lib/libstipple_media.so
build/fuzz/bin/make_corpus build/fuzz/corpus
failed=0
for fuzzer in build/fuzz/bin/fuzz_*; do
  format=${fuzzer##*/fuzz_}
  [ $# -eq 0 ] || [[ " $* " == *" $format "* ]] || continue
  mkdir -p "build/fuzz/corpus/$format"
  echo "Fuzzing $format for $seconds s"
  # Limits: a file of a few kilobytes takes no second and no gigabyte.
  log=build/fuzz/found/$format.log
  if ! ASAN_OPTIONS=detect_leaks=0 "$fuzzer" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 \
      -max_len=16384 -artifact_prefix="build/fuzz/found/$format-" -print_final_stats=1 \
      "build/fuzz/corpus/$format" >"$log" 2>&1; then
    failed=1
    tail -40 "$log"
  fi
  grep -E '^stat::number_of_executed_units' "$log" || true
done
exit $failed
