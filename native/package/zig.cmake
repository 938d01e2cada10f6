# The part that the toolchains of macOS and of Linux on ARM share: clang and libc++ of zig, which fetch.py brings and
# which has the C library of every system that it compiles for. The file that includes this sets STIPPLE_ZIG_KIND,
# _TARGET, _PROCESSOR and _CPU.
set(CMAKE_SYSTEM_PROCESSOR ${STIPPLE_ZIG_PROCESSOR})
# The compilers that zig_compilers.sh has written.
set(STIPPLE_ZIG $ENV{STIPPLE_ZIG})
if(NOT STIPPLE_ZIG)
  cmake_path(SET STIPPLE_ZIG NORMALIZE ${CMAKE_CURRENT_LIST_DIR}/../../build/package/${STIPPLE_ZIG_KIND}/bin)
endif()
set(CMAKE_C_COMPILER ${STIPPLE_ZIG}/cc)
set(CMAKE_CXX_COMPILER ${STIPPLE_ZIG}/c++)
# An archive has no program in it: the ones of Debian's LLVM write those of every system.
find_program(STIPPLE_LLVM_AR llvm-ar REQUIRED)
find_program(STIPPLE_LLVM_RANLIB llvm-ranlib REQUIRED)
set(CMAKE_AR ${STIPPLE_LLVM_AR})
set(CMAKE_RANLIB ${STIPPLE_LLVM_RANLIB})
if(CMAKE_SYSTEM_NAME STREQUAL Darwin)
  # CMake asks for it where something is assembled; libraries for the package keep the names that the linker gives.
  find_program(STIPPLE_INSTALL_NAME_TOOL NAMES llvm-install-name-tool llvm-install-name-tool-14 REQUIRED)
  set(CMAKE_INSTALL_NAME_TOOL ${STIPPLE_INSTALL_NAME_TOOL})
endif()
foreach(language C CXX)
  set(CMAKE_${language}_COMPILER_AR ${CMAKE_AR})
  set(CMAKE_${language}_COMPILER_RANLIB ${CMAKE_RANLIB})
endforeach()
# Libraries of this machine are of another processor; headers of templates serve all and are named one by one.
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
# How CMake would find these asks the linker of macOS for words that zig's does not know.
set(CMAKE_SIZEOF_VOID_P 8)
foreach(language C CXX)
  set(CMAKE_${language}_ABI_COMPILED TRUE)
  set(CMAKE_${language}_SIZEOF_DATA_PTR 8)
  set(CMAKE_${language}_BYTE_ORDER LITTLE_ENDIAN)
endforeach()
