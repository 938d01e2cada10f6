#!/usr/bin/env bash
# Installs the Debian packages that building, running and testing Stipple takes. This is the one list
# of them; the names are the same in Debian 12, Debian 13 and sid. Does nothing when all are there.
#   bash native/install_dependencies.sh            what building, running and testing takes
#   bash native/install_dependencies.sh --package  also what making the add-on's zip takes (native/package)
#   bash native/install_dependencies.sh --windows  the same, and what making and testing the zip for Windows takes
#   bash native/install_dependencies.sh --zig      the same as --package, and what making and testing the zips for macOS
#                                                  and for Linux on ARM takes; npm fetches the compiler
set -euo pipefail

packages=(
  # Building.
  g++ cmake ninja-build ccache pkgconf git
  # The library: parallel loops, linear algebra, vector instructions, neighbour search.
  libtbb-dev libeigen3-dev libhwy-dev libnanoflann-dev
  # Files: JSON, volumes (OpenVDB's headers use Boost's), meshes, pictures, packed splats. The quick
  # start and the tests use OpenImageIO's tools too.
  nlohmann-json3-dev libopenvdb-dev libboost-dev libtinygltf-dev libopenimageio-dev openimageio-tools
  zlib1g-dev libzstd-dev libwebp-dev
  # Matrix products of networks.
  libdnnl-dev
  # The command-line tool.
  libcli11-dev
  # Images of plots: one header that reads and fills the outlines of letters.
  libstb-dev
  # Fuzzing the readers: libFuzzer and the sanitizers come with clang alone.
  clang libclang-rt-dev
  # Tests and benchmarks; readelf and nm look at what the libraries need and export.
  libgtest-dev libgmock-dev libbenchmark-dev binutils python3-numpy python3-pytest
  # Blender, with what it needs to draw without a screen, and a virtual screen for its windows.
  blender libegl1 libegl-mesa0 libgl1-mesa-dri xvfb
)
# Making zips: the compiler that they are made with, and what unpacks sources.
package_packages=(g++-12 dpkg-dev patch xz-utils ca-certificates nasm)
# The compiler for Windows, and what runs its programs here.
windows_packages=(g++-mingw-w64-x86-64-posix wine wine64)
# Archives of libraries, the linker of macOS and what looks into its files; what runs programs of ARM, and a C library.
zig_packages=(llvm llvm-14 lld-16 qemu-user libc6-arm64-cross)
command -v npm >/dev/null || zig_packages+=(npm)
case ${1:-} in
  '') ;;
  --package) packages+=("${package_packages[@]}") ;;
  --windows) packages+=("${package_packages[@]}" "${windows_packages[@]}") ;;
  --zig) packages+=("${package_packages[@]}" "${zig_packages[@]}") ;;
  *) echo "Dependencies: the option is '$1'; it must be --package, --windows or --zig." >&2; exit 1 ;;
esac

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$status" = installed ] || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
  echo "Dependencies: all ${#packages[@]} packages are installed."
  exit 0
fi
if ! command -v apt-get >/dev/null; then
  echo "Dependencies: apt-get is not on this machine; install by other means: ${missing[*]}" >&2
  exit 1
fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "Dependencies: run this as root, or install sudo, to install: ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
install() {
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get "$@" </dev/null
}

echo "Dependencies: installing ${#missing[@]} of ${#packages[@]} packages: ${missing[*]}"
# The package lists of a fresh machine are empty, those of an old one may name files that are gone.
if ! apt-get install --simulate --no-install-recommends "${missing[@]}" </dev/null >/dev/null 2>&1; then
  install update
fi
if ! install install -y --no-install-recommends "${missing[@]}"; then
  install update
  install install -y --no-install-recommends "${missing[@]}"
fi
echo "Dependencies: installed."
