# Toolchain: Windows on x86-64, compiled on Debian by its mingw-w64 with threads of POSIX. What is made needs Windows'
# own libraries alone: libstdc++, libgcc and winpthread are linked in.
set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR AMD64)
set(CMAKE_C_COMPILER x86_64-w64-mingw32-gcc-posix)
set(CMAKE_CXX_COMPILER x86_64-w64-mingw32-g++-posix)
set(CMAKE_RC_COMPILER x86_64-w64-mingw32-windres)
set(CMAKE_AR x86_64-w64-mingw32-gcc-ar-posix)
set(CMAKE_RANLIB x86_64-w64-mingw32-gcc-ranlib-posix)
# Libraries of this machine are Linux's; headers of templates serve both and are named one by one.
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)

# Windows 7 and newer, and the C99 forms of printf.
set(STIPPLE_WINDOWS_FLAGS "-D_WIN32_WINNT=0x0601 -DWINVER=0x0601 -DNOMINMAX -DWIN32_LEAN_AND_MEAN")
string(APPEND STIPPLE_WINDOWS_FLAGS " -D__USE_MINGW_ANSI_STDIO=1 -mthreads")
# Files with many templates have more sections than the old format counts.
string(APPEND STIPPLE_WINDOWS_FLAGS " -Wa,-mbig-obj")
# GCC aligns the stack of a function to 16 bytes on Windows and yet keeps vectors of 32 and 64 bytes there by
# instructions that ask for their whole alignment (GCC bug 54412); the assembler takes those that do not ask.
string(APPEND STIPPLE_WINDOWS_FLAGS " -Wa,-muse-unaligned-vector-move")
# A name of UTF-8 stays one when it becomes a path.
set(STIPPLE_UTF8_PATHS "${CMAKE_CURRENT_LIST_DIR}/../base/platform/windows/utf8_paths.h")
cmake_path(NORMAL_PATH STIPPLE_UTF8_PATHS)
set(CMAKE_C_FLAGS_INIT "${STIPPLE_WINDOWS_FLAGS}")
set(CMAKE_CXX_FLAGS_INIT "${STIPPLE_WINDOWS_FLAGS} -include ${STIPPLE_UTF8_PATHS}")
set(CMAKE_SHARED_LINKER_FLAGS_INIT "-static -static-libgcc -static-libstdc++")
set(CMAKE_EXE_LINKER_FLAGS_INIT "-static -static-libgcc -static-libstdc++")
