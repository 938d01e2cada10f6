#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace tinygltf {
class Model;
}

namespace stipple::media {

/// Values of an accessor as float: normalised integers become -1..1 or 0..1, sparse entries replace
/// what they name. Every range is checked against its buffer.
/// In: width, components per element that are needed; accessors with another number are kFormat.
/// Out: [count, width].
std::vector<float> readFloats(const tinygltf::Model& model, int accessor, size_t width,
                              const std::string& what);

/// The same to floats of the caller's, `out_stride` apart. In: out, room for accessorCount elements
/// of an accessor that requireAccessor lets pass.
void readFloatsTo(const tinygltf::Model& model, int accessor, size_t width, const std::string& what,
                  float* out, size_t out_stride);

/// Elements of an accessor. Errors: kFormat if there is no such accessor.
size_t accessorCount(const tinygltf::Model& model, int accessor, const std::string& what);

/// Refuses accessors that readFloats refuses, before anything is allocated.
void requireAccessor(const tinygltf::Model& model, int accessor, size_t width,
                     const std::string& what);

/// Components per element of an accessor. Errors: kFormat if there is no such accessor.
size_t accessorWidth(const tinygltf::Model& model, int accessor, const std::string& what);

/// Vertex indices of a primitive.
std::vector<uint32_t> readIndices(const tinygltf::Model& model, int accessor,
                                  const std::string& what);

/// The bytes of a buffer view.
std::vector<unsigned char> readView(const tinygltf::Model& model, int view,
                                    const std::string& what);

}  // namespace stipple::media
