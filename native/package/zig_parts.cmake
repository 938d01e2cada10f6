# What the packages of macOS and of Linux on ARM are put together from, with the toolchains that include zig.cmake. libc++
# is linked in, and on Linux what zig has for the compiler.
include(${CMAKE_CURRENT_LIST_DIR}/cross_parts.cmake)
# Warnings of the other compiler are looked at there.
target_compile_options(stipple_flags INTERFACE -Wno-error)
# What nearly every file includes is read once for each folder: libc++ takes longer to read than our code to compile.
find_package(Eigen3 REQUIRED)
include_directories(SYSTEM ${EIGEN3_INCLUDE_DIRS})
target_precompile_headers(stipple_flags INTERFACE <algorithm> <array> <cmath> <cstdint> <functional> <limits> <memory>
  <optional> <span> <string> <vector> <Eigen/Core> <Eigen/Geometry>)

if(NOT APPLE)
  add_library(stipple_settled_names OBJECT ${CMAKE_CURRENT_LIST_DIR}/settled_names.c
    ${CMAKE_CURRENT_LIST_DIR}/stat_calls.c)
  # stipple_package_link(TARGET): links a library or a program for the package.
  function(stipple_package_link TARGET)
    set_target_properties(${TARGET} PROPERTIES BUILD_WITH_INSTALL_RPATH ON)
    target_link_libraries(${TARGET} PRIVATE $<TARGET_OBJECTS:stipple_settled_names>
      ${STIPPLE_PACKAGE_PARTS}/lib/libcompiler_rt.a)
    target_link_options(${TARGET} PRIVATE -Wl,--gc-sections -Wl,--build-id=none -Wl,-z,relro -Wl,-z,now -Wl,-s)
  endfunction()
  return()
endif()

# For macOS LLVM's linker, which takes what is not used away, exports what a list names and signs what it writes. What
# zig would link in lies beside the other parts.
find_program(STIPPLE_LD64 NAMES ld64.lld-16 REQUIRED)
set(lib ${STIPPLE_PACKAGE_PARTS}/lib)
set(libraries "${lib}/libc++.a ${lib}/libc++abi.a ${lib}/libSystem.tbd")
string(REGEX REPLACE "^.*-macos\\." "" version ${STIPPLE_ZIG_TARGET})
set(linker "${STIPPLE_LD64} -arch ${CMAKE_SYSTEM_PROCESSOR} -platform_version macos ${version} ${version}")
string(APPEND linker " -dead_strip -x -adhoc_codesign")
set(CMAKE_CXX_CREATE_SHARED_LIBRARY
  "${linker} -dylib -install_name @rpath/<TARGET_SONAME> <LINK_FLAGS> -o <TARGET> <OBJECTS> <LINK_LIBRARIES> ${libraries}")
set(CMAKE_CXX_LINK_EXECUTABLE
  "${linker} -rpath @executable_path/../lib -o <TARGET> <OBJECTS> <LINK_LIBRARIES> ${libraries}")
function(stipple_package_link TARGET)
  # The folder where the tool looks stands in the lines above.
  set_target_properties(${TARGET} PROPERTIES SKIP_BUILD_RPATH ON)
endfunction()
