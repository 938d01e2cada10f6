# Toolchain: Linux on ARM with 64 bits and a C library of version 2.28 or newer.
set(CMAKE_SYSTEM_NAME Linux)
set(STIPPLE_ZIG_KIND linux_arm64)
set(STIPPLE_ZIG_TARGET aarch64-linux-gnu.2.28)
set(STIPPLE_ZIG_PROCESSOR aarch64)
set(STIPPLE_ZIG_CPU generic)
include(${CMAKE_CURRENT_LIST_DIR}/zig.cmake)
