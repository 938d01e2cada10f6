#!/usr/bin/env bash
# Runs the fuzzer of every reader, or of those that are named, for so many seconds each (default 60).
#   bash tests/fuzz/run.sh [SECONDS] [READER...]
#   bash tests/fuzz/run.sh --build READER...          builds only, and checks that these are all readers
#   bash tests/fuzz/run.sh --run SECONDS READER...    runs what is built, from the same dice every time: what it
#                                                     finds, it finds again
# They start from small valid files (build/fuzz/corpus, where what they discover stays) and from the
# files that once were faults (tests/fuzz/found). What they find lies in build/fuzz/found, named after its
# reader. Needs clang with libFuzzer (Debian: clang libclang-rt-dev), and says so where it is missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

build() {
  local jobs=${STIPPLE_JOBS:-$(bash native/build_jobs.sh)}
  cmake --preset fuzz
  cmake --build build/fuzz --target fuzzers --parallel "$jobs"
  local work
  work=$(mktemp -d)
  build/fuzz/bin/make_corpus build/fuzz/corpus "$work"
  rm -r "$work"
}

readers() {
  (cd build/fuzz/corpus && printf '%s\n' *)
}

# Runs one fuzzer; its whole output goes to a log, the end of it is shown where it finds something.
fuzz() {
  local seconds=$1 reader=$2 work status=0 longest=16384
  # Networks make even a small file of theirs long.
  case $reader in scaffold | relay) longest=65536 ;; esac
  local log=build/fuzz/found/$reader.log
  mkdir -p build/fuzz/found
  if [ ! -d "build/fuzz/corpus/$reader" ]; then
    echo "There is no reader '$reader'; there are: $(readers | tr '\n' ' ')" >&2
    return 2
  fi
  # In memory where possible: thousands of files are written per second.
  work=$(mktemp -d -p "$([ -w /dev/shm ] && echo /dev/shm || echo /tmp)")
  local from=("build/fuzz/corpus/$reader")
  if [ -d "tests/fuzz/found/$reader" ]; then from+=("tests/fuzz/found/$reader"); fi
  # Limits: a file of a few kilobytes takes no second and no gigabyte.
  STIPPLE_FUZZ_READER=$reader STIPPLE_FUZZ_FOLDER=$work ASAN_OPTIONS=detect_leaks=0 \
    build/fuzz/bin/fuzz_reader -max_total_time="$seconds" -timeout=25 -rss_limit_mb=2048 \
    -max_len=$longest -artifact_prefix="build/fuzz/found/$reader-" -print_final_stats=1 -seed="$seed" \
    "${from[@]}" >"$log" 2>&1 || status=1
  rm -r "$work"
  if [ $status -ne 0 ]; then tail -60 "$log"; fi
  echo "$reader: $(sed -n 's/^stat::number_of_executed_units: *//p' "$log") files," \
    "coverage $(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$log" | tail -1)"
  return $status
}

if ! command -v clang++ >/dev/null ||
    ! echo 'extern "C" int LLVMFuzzerTestOneInput(const unsigned char*, unsigned long) { return 0; }' |
      clang++ -x c++ -fsanitize=fuzzer,address - -o /dev/null 2>/dev/null; then
  echo "Fuzzing is skipped: clang++ with libFuzzer is not installed (Debian: clang libclang-rt-dev)."
  exit 0
fi
mode=${1:-}
seed=0  # other dice every time
case $mode in
  --build)
    build
    if ! diff <(printf '%s\n' "${@:2}" | sort) <(readers | sort); then
      echo "The readers that are named (<) are not those that can be fuzzed (>)" >&2
      exit 1
    fi
    exit 0 ;;
  --run)
    seconds=$2
    seed=1
    shift 2 ;;
  *)
    seconds=${1:-60}
    shift || true
    build ;;
esac
[ $# -gt 0 ] || mapfile -t all < <(readers)
failed=0
for reader in "${@:-${all[@]}}"; do
  fuzz "$seconds" "$reader" || failed=1
done
exit $failed
