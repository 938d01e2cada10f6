#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "math/vec.h"

namespace tinygltf {
struct Primitive;
}  // namespace tinygltf

namespace stipple::media {

struct GltfModel;

/// What a file of meshes may require.
const std::set<std::string>& knownMeshExtensions();

/// glTF is Y up and looks along +Z; here Z is up: (x, y, z) → (x, −z, y).
Mat4d gltfToZUp();

/// The accessor of an attribute, -1 where there is none.
int attributeOf(const tinygltf::Primitive& primitive, const std::string& name);

int modeOf(const tinygltf::Primitive& primitive);

/// Points and lines have no surface.
bool hasSurface(const tinygltf::Primitive& primitive);

/// How many corners the triangles of a primitive with so many indices have.
uint64_t cornerCount(uint64_t index_count, int mode);

/// Vertices of the corners of a primitive's triangles, three per triangle. In: count of vertices;
/// matrix, of its use: one that mirrors turns triangles inside out, and this turns them back; what,
/// for messages. Errors: kFormat for indices beyond the vertices.
std::vector<uint32_t> surfaceCorners(const GltfModel& model, const tinygltf::Primitive& primitive,
                                     size_t count, const Mat4d& matrix, const std::string& what);

}  // namespace stipple::media
