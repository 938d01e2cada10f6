#!/usr/bin/env bash
# Builds Stipple in Debian trixie (Blender 4.3) and sid (Blender 5.2), and runs the add-on's tests in each. Needs root.
#   bash tests/run_blender_matrix.sh                 both
#   bash tests/run_blender_matrix.sh sid             one
#   bash tests/run_blender_matrix.sh sid -R budget   only the tests whose names match, as ctest has it
# Or takes the zip of a release, builds nothing, and runs it where there is Blender and no compiler; bookworm (Blender
# 3.4) is among the suites then.
#   bash tests/run_blender_matrix.sh --zip build/stipple-0.1.0-linux_x64.zip [bookworm trixie sid] [-k budget]
# STIPPLE_SUITES: where the suites are made, 2.5 GB each (default build/suites). They stay for the next run.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
folder=${STIPPLE_SUITES:-build/suites}
all=(trixie sid) zip='' kind=()
if [[ ${1:-} == --zip ]]; then
  zip=$(realpath --relative-to=. "${2:?the zip of a release is missing after --zip}")
  [[ -f $zip && $zip != ../* ]] || { echo "run_blender_matrix.sh: '$zip' is no file of this project." >&2; exit 1; }
  all=(bookworm trixie sid) kind=(bare)
  shift 2
fi

suites=()
while [[ " ${all[*]} " == *" ${1:-none} "* ]]; do
  suites+=("$1")
  shift
done
((${#suites[@]})) || suites=("${all[@]}")
chosen=("$@")

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

# The zip as Blender installs it, and then the add-on's tests with the add-on and the library that lie in it.
read -r -d '' install_and_test <<'INSIDE' || true
zip=$1 && shift
set -e
if command -v c++; then
  echo 'This suite has a compiler; a bare one has none.' >&2
  exit 1
fi
blender --version | head -1
export STIPPLE_ZIP=$PWD/$zip
python3 -m pytest -q -rs -p no:cacheprovider tests/package/test_in_blender.py
unpacked=$(mktemp -d)
python3 -m zipfile -e "$zip" "$unpacked"
STIPPLE_BUILD_DIR=$PWD/build/portable python3 tests/blender/run.py --addon "$unpacked/stipple" \
  --library "$unpacked/stipple/lib/libstipple.so" -q -rs "$@"
INSIDE

failed=()
for suite in "${suites[@]}"; do
  echo "== $suite"
  root=$folder/$suite${kind[0]:+-${kind[0]}}
  bash tests/blender_suite.sh prepare "$suite" "$root" "${kind[@]}"
  if [[ -n $zip ]]; then
    command=("$install_and_test" sh "$zip")
  else
    ((${#chosen[@]})) || chosen=(-R '^(addon|blender|blend_fixtures|cli)\.')
    command=("$build_and_test" sh "$suite")
  fi
  bash tests/blender_suite.sh run "$root" bash -c "${command[@]}" "${chosen[@]}" || failed+=("$suite")
done
if ((${#failed[@]})); then
  echo "The tests failed in: ${failed[*]}" >&2
  exit 1
fi
echo "The tests passed in: ${suites[*]}"
