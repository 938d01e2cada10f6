# What the Windows package is put together from: the static libraries and the headers in STIPPLE_PACKAGE_PARTS, which
# `native/package/make_parts.sh --windows` makes with the toolchain windows.cmake.
foreach(file lib/libtbb.a lib/libhwy.a lib/libOpenEXR-3_1.a include/tbb/parallel_for.h)
  if(NOT EXISTS ${STIPPLE_PACKAGE_PARTS}/${file})
    message(FATAL_ERROR "${STIPPLE_PACKAGE_PARTS}/${file} is missing; run native/package/make_parts.sh --windows")
  endif()
endforeach()
if(NOT CMAKE_CXX_COMPILER_VERSION MATCHES "^12\\.")
  message(FATAL_ERROR "Packages are built by GCC 12, as in Debian 12; this is ${CMAKE_CXX_COMPILER_VERSION}")
endif()
# Folders of headers alone: this machine's own, under /usr/include, would bring those of its C library.
include_directories(SYSTEM ${STIPPLE_PACKAGE_PARTS}/include)
set(STIPPLE_STB_INCLUDE ${STIPPLE_PACKAGE_PARTS}/include CACHE PATH "")

# stipple_part(TARGET NAME): a static library of the parts, under the name that the build knows it by.
function(stipple_part TARGET NAME)
  add_library(${TARGET} STATIC IMPORTED GLOBAL)
  set_target_properties(${TARGET} PROPERTIES IMPORTED_LOCATION ${STIPPLE_PACKAGE_PARTS}/lib/lib${NAME}.a)
endfunction()
stipple_part(TBB::tbb tbb)
stipple_part(hwy::hwy hwy)
set_target_properties(hwy::hwy PROPERTIES INTERFACE_COMPILE_DEFINITIONS HWY_STATIC_DEFINE)

# Libraries of headers.
foreach(library nlohmann_json::nlohmann_json nanoflann::nanoflann CLI11::CLI11)
  add_library(${library} INTERFACE IMPORTED GLOBAL)
endforeach()

set(STIPPLE_PACKAGE_SOURCES ${STIPPLE_PACKAGE_PARTS}/../source)
include(${CMAKE_CURRENT_LIST_DIR}/media_parts.cmake)

# stipple_package_link(TARGET): links a library or a program for the package. windows.cmake says that the compiler's
# libraries are linked in.
function(stipple_package_link TARGET)
  # Names of files of any length for libstdc++, whose functions it finds before those of the C library.
  target_link_libraries(${TARGET} PRIVATE stipple_base)
  foreach(symbol __imp__wstat64 __imp__wmkdir __imp__wfopen __imp_DeleteFileW __imp_RemoveDirectoryW _wopendir)
    target_link_options(${TARGET} PRIVATE -Wl,-u,${symbol})
  endforeach()
  # Without a time in the file equal sources give equal bytes.
  target_link_options(${TARGET} PRIVATE -Wl,--gc-sections -Wl,--no-insert-timestamp -Wl,--exclude-all-symbols
    -Wl,--dynamicbase -Wl,--nxcompat -Wl,--high-entropy-va -Wl,-s)
endfunction()
