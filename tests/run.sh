#!/usr/bin/env bash
# Installs what is missing, builds, and runs every test. Arguments go to ctest:
#   bash tests/run.sh                 everything
#   bash tests/run.sh -R structure    the tests whose names match
#   bash tests/run.sh --fuzz [S]      the fuzzers of the readers instead, S seconds each (default 60)
#   bash tests/run.sh --bench [ARG]   the benchmarks that have limits instead (native/bench/limits.txt), each by turns
#                                     with its reference; --only REGEX: those whose names match. Fails on a miss
# STIPPLE_JOBS: compilers and tests at a time (default: one per core, with 2 GiB of memory each).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bash native/install_dependencies.sh
if [ "${1:-}" = --fuzz ]; then
  exec bash tests/fuzz/run.sh "${@:2}"
fi
jobs=${STIPPLE_JOBS:-$(bash native/build_jobs.sh)}
cmake --preset release
if [ "${1:-}" = --bench ]; then
  cmake --build build/release --parallel "$jobs" --target stipple_bench
  exec python3 tests/bench.py build/release/bin/stipple_bench "${@:2}"
fi
cmake --build build/release --parallel "$jobs"
exec ctest --test-dir build/release --output-on-failure --parallel "$jobs" "$@"
