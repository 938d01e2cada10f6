# Sourced by the scripts that compare with OpenSplat: checks what is needed and builds the peer for the CPU.
# In: OPENSPLAT_SOURCE, OPENSPLAT_BUILD_DIR (default build/peers/opensplat). Out: $root, $build, $peer_build.
# Exit 77: something is missing, and which.
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=${STIPPLE_BUILD_DIR:-$root/build/release}
peer_build=${OPENSPLAT_BUILD_DIR:-$root/build/peers/opensplat}

missing() {
  echo "$(basename "$0"): $1" >&2
  exit 77
}

build_opensplat() {
  if [[ -z ${OPENSPLAT_SOURCE:-} || ! -f ${OPENSPLAT_SOURCE:-}/opensplat.cpp ]]; then
    missing "OPENSPLAT_SOURCE is '${OPENSPLAT_SOURCE:-}'; it must be a folder with the source of OpenSplat (github.com/pierotofy/OpenSplat)."
  fi
  local packages=() package
  for package in libtorch-dev libopencv-dev nlohmann-json3-dev libnanoflann-dev libcxxopts-dev; do
    dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed || packages+=("$package")
  done
  ((${#packages[@]} == 0)) || missing "packages are missing; apt-get install ${packages[*]}"

  # OpenSplat would download its header libraries; these folders stand for them and find the system's.
  for package in nlohmann_json nanoflann cxxopts; do
    mkdir -p "$peer_build/found/$package"
    echo "find_package($package REQUIRED GLOBAL)" > "$peer_build/found/$package/CMakeLists.txt"
  done
  echo "Building OpenSplat for the CPU in $peer_build (log: $peer_build/build.log)"
  {
    cmake -S "$OPENSPLAT_SOURCE" -B "$peer_build" -DGPU_RUNTIME=CPU -DCMAKE_BUILD_TYPE=Release \
      -DFETCHCONTENT_FULLY_DISCONNECTED=ON \
      -DFETCHCONTENT_SOURCE_DIR_NLOHMANN_JSON="$peer_build/found/nlohmann_json" \
      -DFETCHCONTENT_SOURCE_DIR_NANOFLANN="$peer_build/found/nanoflann" \
      -DFETCHCONTENT_SOURCE_DIR_CXXOPTS="$peer_build/found/cxxopts"
    cmake --build "$peer_build" --target opensplat --parallel "${STIPPLE_JOBS:-1}"
  } > "$peer_build/build.log" 2>&1 || missing "OpenSplat could not be built; the end of $peer_build/build.log says why"
}
