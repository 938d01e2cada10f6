# What the packages for other systems than this one share: the headers and the static libraries in
# STIPPLE_PACKAGE_PARTS, which native/package/make_parts.sh makes with the same toolchain.
foreach(file lib/libtbb.a lib/libhwy.a lib/libOpenEXR-3_1.a include/tbb/parallel_for.h)
  if(NOT EXISTS ${STIPPLE_PACKAGE_PARTS}/${file})
    message(FATAL_ERROR "${STIPPLE_PACKAGE_PARTS}/${file} is missing; run native/package/make_parts.sh --PLATFORM")
  endif()
endforeach()
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
