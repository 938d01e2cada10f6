# The part that the toolchains of macOS and of Linux on ARM share: clang and libc++ of zig, which fetch.py brings and
# which has the C library of every system that it compiles for. STIPPLE_ZIG_TARGET and STIPPLE_ZIG_PROCESSOR are set.
set(CMAKE_SYSTEM_PROCESSOR ${STIPPLE_ZIG_PROCESSOR})
set(STIPPLE_ZIG $ENV{STIPPLE_ZIG})
if(NOT STIPPLE_ZIG)
  cmake_path(SET STIPPLE_ZIG NORMALIZE ${CMAKE_CURRENT_LIST_DIR}/../../build/package/zig/zig)
endif()
set(CMAKE_C_COMPILER ${STIPPLE_ZIG} cc -target ${STIPPLE_ZIG_TARGET} -mcpu=${STIPPLE_ZIG_CPU})
set(CMAKE_CXX_COMPILER ${STIPPLE_ZIG} c++ -target ${STIPPLE_ZIG_TARGET} -mcpu=${STIPPLE_ZIG_CPU})
# An archive has no program in it: the ones of Debian's LLVM write those of every system.
find_program(STIPPLE_LLVM_AR llvm-ar REQUIRED)
find_program(STIPPLE_LLVM_RANLIB llvm-ranlib REQUIRED)
set(CMAKE_AR ${STIPPLE_LLVM_AR})
set(CMAKE_RANLIB ${STIPPLE_LLVM_RANLIB})
foreach(language C CXX)
  set(CMAKE_${language}_COMPILER_AR ${CMAKE_AR})
  set(CMAKE_${language}_COMPILER_RANLIB ${CMAKE_RANLIB})
endforeach()
# Libraries of this machine are of another processor; headers of templates serve all and are named one by one.
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
# zig keeps what it compiled by itself, and without a level of optimisation it adds checks of its own.
set(CMAKE_C_COMPILER_LAUNCHER "")
set(CMAKE_CXX_COMPILER_LAUNCHER "")
set(CMAKE_C_FLAGS_INIT "-fno-sanitize=undefined")
set(CMAKE_CXX_FLAGS_INIT "-fno-sanitize=undefined")
# How CMake would find these asks the linker of macOS for words that zig's does not know.
set(CMAKE_SIZEOF_VOID_P 8)
foreach(language C CXX)
  set(CMAKE_${language}_ABI_COMPILED TRUE)
  set(CMAKE_${language}_SIZEOF_DATA_PTR 8)
  set(CMAKE_${language}_BYTE_ORDER LITTLE_ENDIAN)
endforeach()
