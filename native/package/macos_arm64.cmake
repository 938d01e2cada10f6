# Toolchain: macOS 11 and newer on Apple's own processors.
set(CMAKE_SYSTEM_NAME Darwin)
set(STIPPLE_ZIG_KIND macos_arm64)
set(STIPPLE_ZIG_TARGET aarch64-macos.11.0)
set(STIPPLE_ZIG_PROCESSOR arm64)
set(STIPPLE_ZIG_CPU apple_m1)
include(${CMAKE_CURRENT_LIST_DIR}/zig.cmake)
