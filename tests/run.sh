#!/usr/bin/env bash
# Installs what is missing, builds, and runs every test. Arguments go to ctest:
#   bash tests/run.sh                 everything
#   bash tests/run.sh -R structure    the tests whose names match
# STIPPLE_JOBS: compilers and tests at a time (default: one per core, with 2 GiB of memory each).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bash native/install_dependencies.sh
jobs=${STIPPLE_JOBS:-$(bash native/build_jobs.sh)}
cmake --preset release
cmake --build build/release --parallel "$jobs"
exec ctest --test-dir build/release --output-on-failure --parallel "$jobs" "$@"
