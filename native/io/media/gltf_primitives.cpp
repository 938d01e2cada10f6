// Based on: The Khronos 3D Formats Working Group, glTF 2.0 Specification, section 3.7 (primitives,
// strips and fans).
#include "io/media/gltf_primitives.h"

#include <Eigen/LU>
#include <utility>

#include "base/error.h"
#include "io/media/gltf_accessor.h"
#include "io/media/gltf_model.h"

namespace stipple::media {

namespace {

/// Corners of the triangles of a primitive, three per triangle.
std::vector<uint32_t> triangleCorners(const std::vector<uint32_t>& indices, int mode) {
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    std::vector<uint32_t> corners = indices;
    corners.resize(corners.size() / 3 * 3);
    return corners;
  }
  std::vector<uint32_t> corners;
  for (size_t i = 0; i + 2 < indices.size(); ++i) {
    if (mode == TINYGLTF_MODE_TRIANGLE_FAN) {
      corners.insert(corners.end(), {indices[0], indices[i + 1], indices[i + 2]});
    } else {
      // Every second triangle of a strip is turned.
      const size_t odd = i % 2;
      corners.insert(corners.end(), {indices[i], indices[i + 1 + odd], indices[i + 2 - odd]});
    }
  }
  return corners;
}

std::vector<uint32_t> indicesOf(const GltfModel& model, const tinygltf::Primitive& primitive,
                                size_t count, const std::string& what) {
  if (primitive.indices < 0) {
    std::vector<uint32_t> indices(count);
    for (size_t i = 0; i < count; ++i) indices[i] = static_cast<uint32_t>(i);
    return indices;
  }
  std::vector<uint32_t> indices = readIndices(model, primitive.indices, what + ", indices");
  for (const uint32_t index : indices) {
    if (index >= count) {
      fail(ErrorCode::kFormat,
           what + " uses vertex " + std::to_string(index) + " of " + std::to_string(count));
    }
  }
  return indices;
}

}  // namespace

const std::set<std::string>& knownMeshExtensions() {
  static const std::set<std::string> kKnown = {"KHR_texture_transform", "KHR_mesh_quantization",
                                               "KHR_materials_unlit", "EXT_texture_webp"};
  return kKnown;
}

Mat4d gltfToZUp() {
  Mat4d matrix;
  matrix << 1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1;
  return matrix;
}

int attributeOf(const tinygltf::Primitive& primitive, const std::string& name) {
  const auto found = primitive.attributes.find(name);
  return found == primitive.attributes.end() ? -1 : found->second;
}

int modeOf(const tinygltf::Primitive& primitive) {
  return primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
}

bool hasSurface(const tinygltf::Primitive& primitive) {
  const int mode = modeOf(primitive);
  return mode >= TINYGLTF_MODE_TRIANGLES && mode <= TINYGLTF_MODE_TRIANGLE_FAN &&
         attributeOf(primitive, "POSITION") >= 0;
}

uint64_t cornerCount(uint64_t index_count, int mode) {
  if (mode == TINYGLTF_MODE_TRIANGLES) return index_count / 3 * 3;
  return index_count < 3 ? 0 : (index_count - 2) * 3;
}

std::vector<uint32_t> surfaceCorners(const GltfModel& model, const tinygltf::Primitive& primitive,
                                     size_t count, const Mat4d& matrix, const std::string& what) {
  std::vector<uint32_t> corners =
      triangleCorners(indicesOf(model, primitive, count, what), modeOf(primitive));
  if (matrix.topLeftCorner<3, 3>().determinant() < 0) {
    for (size_t t = 0; t + 2 < corners.size(); t += 3) std::swap(corners[t + 1], corners[t + 2]);
  }
  return corners;
}

}  // namespace stipple::media
