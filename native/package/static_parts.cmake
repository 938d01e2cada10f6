# What a package is put together from instead of the machine's shared libraries: the static libraries and the stubs of
# glibc 2.28 in STIPPLE_PACKAGE_PARTS, which native/package/make_parts.sh makes. Code is compiled as in every other
# build; what is linked is other.
foreach(file lib/libtbb.a lib/libhwy.a stubs/libc.so stubs/libgcc_eh.a)
  if(NOT EXISTS ${STIPPLE_PACKAGE_PARTS}/${file})
    message(FATAL_ERROR "${STIPPLE_PACKAGE_PARTS}/${file} is missing; run native/package/make_parts.sh")
  endif()
endforeach()
if(NOT CMAKE_CXX_COMPILER_ID STREQUAL GNU OR NOT CMAKE_CXX_COMPILER_VERSION MATCHES "^12\\.")
  # The static libstdc++ of a later suite asks for a later C library.
  message(FATAL_ERROR "Packages are built by GCC 12, as in Debian 12; this is ${CMAKE_CXX_COMPILER_ID} "
                      "${CMAKE_CXX_COMPILER_VERSION}")
endif()

# stipple_part(TARGET NAME HEADER TEXT...): a static library of the parts, under the name that the build knows it by.
# Its headers are the machine's, which must be of the same version: each text stands in HEADER.
function(stipple_part TARGET NAME HEADER)
  find_file(STIPPLE_HEADER_OF_${NAME} ${HEADER} REQUIRED)
  file(READ ${STIPPLE_HEADER_OF_${NAME}} content)
  foreach(text IN LISTS ARGN)
    if(NOT content MATCHES "${text}")
      message(FATAL_ERROR "${STIPPLE_HEADER_OF_${NAME}} has no \"${text}\": lib${NAME}.a is of another version")
    endif()
  endforeach()
  add_library(${TARGET} STATIC IMPORTED GLOBAL)
  set_target_properties(${TARGET} PROPERTIES IMPORTED_LOCATION ${STIPPLE_PACKAGE_PARTS}/lib/lib${NAME}.a)
endfunction()

stipple_part(TBB::tbb tbb oneapi/tbb/version.h
  "TBB_VERSION_MAJOR 2021" "TBB_VERSION_MINOR 8" "TBB_VERSION_PATCH 0")
find_package(PkgConfig REQUIRED)
pkg_check_modules(STIPPLE_HWY REQUIRED libhwy=1.0.3)
stipple_part(hwy::hwy hwy hwy/highway.h)
# The same compiler's command as in other builds, so that nothing is compiled twice.
set_target_properties(hwy::hwy PROPERTIES INTERFACE_COMPILE_DEFINITIONS HWY_SHARED_DEFINE)

set(STIPPLE_PACKAGE_SOURCES ${STIPPLE_PACKAGE_PARTS}/source)
include(${CMAKE_CURRENT_LIST_DIR}/media_parts.cmake)

# What libraries of others and of the compiler refer to and glibc 2.28 lacks.
add_library(stipple_older_glibc OBJECT ${CMAKE_CURRENT_LIST_DIR}/older_glibc.c)

# stipple_package_link(TARGET): links a library or a program for a package.
function(stipple_package_link TARGET)
  target_link_libraries(${TARGET} PRIVATE $<TARGET_OBJECTS:stipple_older_glibc> -lpthread -ldl)
  set_target_properties(${TARGET} PROPERTIES BUILD_WITH_INSTALL_RPATH ON)
  # What is weak and not there (an allocator of oneTBB, its NUMA bindings) is settled here, not by what Blender has.
  target_link_options(${TARGET} PRIVATE -static-libstdc++ -static-libgcc
    -B${STIPPLE_PACKAGE_PARTS}/stubs -L${STIPPLE_PACKAGE_PARTS}/stubs -Wl,-z,nodynamic-undefined-weak
    -Wl,--gc-sections -Wl,--build-id=none -Wl,-z,relro -Wl,-z,now -Wl,--exclude-libs,ALL -Wl,-s)
endfunction()
