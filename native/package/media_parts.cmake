# What reads and writes files inside a package, of the folders STIPPLE_PACKAGE_PARTS and STIPPLE_PACKAGE_SOURCES.
# stipple_media_parts(TARGET): the headers of what reads and writes files, before those of this machine.
function(stipple_media_parts TARGET)
  set(sources ${STIPPLE_PACKAGE_SOURCES})
  target_include_directories(${TARGET} SYSTEM BEFORE PRIVATE
    ${STIPPLE_PACKAGE_PARTS}/include ${STIPPLE_PACKAGE_PARTS}/include/openvdb ${STIPPLE_PACKAGE_PARTS}/include/Imath
    ${STIPPLE_PACKAGE_PARTS}/include/OpenEXR
    ${sources}/openvdb/openvdb ${sources}/tinygltf ${sources}/png ${sources}/webp/src ${sources}/zlib ${sources}/zstd/lib)
  if(STIPPLE_ZIG)
    # Boost 1.74 has a base class that C++17 took away and libc++ keeps for those who ask.
    target_compile_definitions(${TARGET} PRIVATE _LIBCPP_ENABLE_CXX17_REMOVED_UNARY_BINARY_FUNCTION)
  elseif(WIN32)
    # Without them OpenVDB's headers look for it, and for OpenEXR, in a .dll.
    target_compile_definitions(${TARGET} PRIVATE OPENVDB_STATICLIB OPENVDB_OPENEXR_STATICLIB)
  endif()
endfunction()
# The libraries behind them, each before those that it calls.
set(STIPPLE_MEDIA_LIBRARIES openvdb blosc lz4 zstd tinygltf png jpeg webp
  OpenEXR-3_1 Iex-3_1 IlmThread-3_1 OpenEXRCore-3_1 Imath-3_1 z)
list(TRANSFORM STIPPLE_MEDIA_LIBRARIES REPLACE "^(.+)$" "${STIPPLE_PACKAGE_PARTS}/lib/lib\\1.a")
