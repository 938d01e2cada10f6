#!/usr/bin/env bash
# Builds Stipple in Debian trixie (Blender 4.3) and sid (Blender 5.2), and runs the add-on's tests in each. Needs root.
#   bash tests/run_blender_matrix.sh                 both
#   bash tests/run_blender_matrix.sh sid             one
#   bash tests/run_blender_matrix.sh sid -R budget   only the tests whose names match, as ctest has it
# STIPPLE_SUITES: where the suites are made, 2.5 GB each (default build/suites). They stay for the next run.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
folder=${STIPPLE_SUITES:-build/suites}

suites=()
while [[ ${1:-} == trixie || ${1:-} == sid ]]; do
  suites+=("$1")
  shift
done
((${#suites[@]})) || suites=(trixie sid)
chosen=("$@")
((${#chosen[@]})) || chosen=(-R '^(addon|blender|blend_fixtures|cli)\.')

# The tests that start Blender, the tool or the library; the native ones do not depend on Blender's version.
read -r -d '' build_and_test <<'INSIDE' || true
suite=$1 && shift
set -e
bash native/install_dependencies.sh
jobs=${STIPPLE_JOBS:-$(bash native/build_jobs.sh)}
cmake -S . -B "build/$suite" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSTIPPLE_BUILD_TESTS=ON >/dev/null
cmake --build "build/$suite" --parallel "$jobs" --target stipple stipple_media stipple_tool
blender --version | head -1
exec ctest --test-dir "build/$suite" --output-on-failure --parallel 1 "$@"
INSIDE

failed=()
for suite in "${suites[@]}"; do
  echo "== $suite"
  bash tests/blender_suite.sh prepare "$suite" "$folder/$suite"
  bash tests/blender_suite.sh run "$folder/$suite" bash -c "$build_and_test" sh "$suite" "${chosen[@]}" || failed+=("$suite")
done
if ((${#failed[@]})); then
  echo "The tests failed in: ${failed[*]}" >&2
  exit 1
fi
echo "The tests passed in: ${suites[*]}"
