# Toolchain: macOS 11 and newer on processors of Intel.
set(CMAKE_SYSTEM_NAME Darwin)
set(STIPPLE_ZIG_KIND macos_x64)
set(STIPPLE_ZIG_TARGET x86_64-macos.11.0)
set(STIPPLE_ZIG_PROCESSOR x86_64)
set(STIPPLE_ZIG_CPU baseline)
include(${CMAKE_CURRENT_LIST_DIR}/zig.cmake)
