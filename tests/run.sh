#!/usr/bin/env bash
# Installs what is missing, builds, and runs every test. Arguments go to ctest:
#   bash tests/run.sh                 everything
#   bash tests/run.sh -R structure    the tests whose names match
#   bash tests/run.sh --fuzz [S]      the fuzzers of the readers instead, S seconds each (default 60)
# STIPPLE_JOBS: compilers and tests at a time (default: one per core, with 2 GiB of memory each).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bash native/install_dependencies.sh
if [ "${1:-}" = --fuzz ]; then
  exec bash tests/fuzz/run.sh "${@:2}"
fi
jobs=${STIPPLE_JOBS:-$(bash native/build_jobs.sh)}
cmake --preset release
cmake --build build/release --parallel "$jobs"
exec ctest --test-dir build/release --output-on-failure --parallel "$jobs" "$@"
