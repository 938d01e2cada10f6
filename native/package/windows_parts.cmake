# What the Windows package is put together from, with the toolchain windows.cmake.
if(NOT CMAKE_CXX_COMPILER_VERSION MATCHES "^12\\.")
  message(FATAL_ERROR "Packages are built by GCC 12, as in Debian 12; this is ${CMAKE_CXX_COMPILER_VERSION}")
endif()
include(${CMAKE_CURRENT_LIST_DIR}/cross_parts.cmake)

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
