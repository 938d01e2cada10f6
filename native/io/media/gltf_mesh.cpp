// Based on: The Khronos 3D Formats Working Group, glTF 2.0 Specification, sections 3.5 (scenes and
// node transforms) and 3.7 (primitives, strips and fans).
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "io/bytes/limits.h"
#include "io/media/gltf_accessor.h"
#include "io/media/gltf_material.h"
#include "io/media/gltf_model.h"
#include "io/media/gltf_primitives.h"
#include "io/media/gltf_scene.h"
#include "io/media/media_calls.h"
#include "math/vec.h"

namespace stipple::media {

namespace {

class GltfReader {
 public:
  explicit GltfReader(const std::string& path)
      : path_(path),
        scene_(path, knownMeshExtensions(), GltfScene::Content::kMesh),
        model_(scene_.model()),
        materials_(model_, path_, scene_, mesh_) {}

  TriMesh read() {
    requireAllowedUses();
    scene_.visitMeshes(gltfToZUp(),
                       [this](size_t mesh, const Mat4d& matrix) { addMesh(mesh, matrix); });
    if (mesh_.triangles.empty()) {
      fail(ErrorCode::kFormat, path_ + " holds no triangles in its scene; at least one is needed");
    }
    finishNormals();
    if (!any_uvs_) mesh_.corner_uvs.clear();
    if (!any_colours_) mesh_.corner_colours.clear();
    return std::move(mesh_);
  }

 private:
  /// Bytes of what a primitive becomes at each of its uses; lying counts stand for themselves.
  uint64_t bytesOf(const tinygltf::Primitive& primitive, const std::string& what) const {
    constexpr uint64_t kVertexBytes = 3 * sizeof(float);
    constexpr uint64_t kCornerBytes = sizeof(uint32_t) + (3 + 4 + 2) * sizeof(float);
    constexpr uint64_t kBeyondMeasure = uint64_t{1} << 50;
    if (!hasSurface(primitive)) return 0;
    const int position = attributeOf(primitive, "POSITION");
    requireAccessor(model_, position, 3, what + ", POSITION");
    const uint64_t vertices = accessorCount(model_, position, what + ", POSITION");
    const uint64_t indices = primitive.indices < 0
                                 ? vertices
                                 : accessorCount(model_, primitive.indices, what + ", indices");
    if (vertices > kBeyondMeasure || indices > kBeyondMeasure) return kBeyondMeasure;
    const uint64_t corners = cornerCount(indices, modeOf(primitive));
    return vertices * kVertexBytes + corners * kCornerBytes + corners / 3 * sizeof(uint32_t);
  }

  /// Refuses a scene that shows its meshes more often than its size allows.
  void requireAllowedUses() const {
    std::map<size_t, uint64_t> bytes_of_mesh;
    uint64_t bytes = 0;
    uint64_t uses = 0;
    scene_.visitMeshes(Mat4d::Identity(), [&](size_t mesh, const Mat4d&) {
      const auto [entry, is_new] = bytes_of_mesh.emplace(mesh, 0);
      const auto& primitives = model_.meshes[mesh].primitives;
      for (size_t p = 0; is_new && p < primitives.size(); ++p) {
        entry->second += bytesOf(primitives[p], nameOf(mesh, p));
        requireInstances(entry->second,
                         std::to_string(p + 1) + " primitives of mesh " + std::to_string(mesh));
      }
      bytes += entry->second;
      requireInstances(bytes, std::to_string(++uses) + " uses of its meshes");
    });
  }

  void requireInstances(uint64_t bytes, const std::string& what) const {
    requireAllowed(bytes, kInstanceAllowance, scene_.fileBytes(), path_, what);
  }

  std::string nameOf(size_t mesh, size_t primitive) const {
    return path_ + ": mesh " + std::to_string(mesh) + ", primitive " + std::to_string(primitive);
  }

  void addMesh(size_t index, const Mat4d& matrix) {
    const tinygltf::Mesh& mesh = model_.meshes[index];
    for (size_t p = 0; p < mesh.primitives.size(); ++p) {
      if (hasSurface(mesh.primitives[p])) {
        addPrimitive(mesh.primitives[p], matrix, nameOf(index, p));
      }
    }
  }

  void addPrimitive(const tinygltf::Primitive& primitive, const Mat4d& matrix,
                    const std::string& what) {
    const int position = attributeOf(primitive, "POSITION");
    const std::vector<float> positions = readFloats(model_, position, 3, what + ", POSITION");
    const size_t count = positions.size() / 3;
    requireFiniteHere(positions, 3, what + ", POSITION");
    const size_t first = mesh_.vertexCount();
    if (count >= UINT32_MAX - first) {
      fail(ErrorCode::kUnsupported, path_ + " holds more than 4,294,967,295 vertices");
    }

    const std::vector<uint32_t> corners = surfaceCorners(model_, primitive, count, matrix, what);
    // Files have such parts although glTF wants one element at least; they add nothing.
    if (corners.empty()) return;

    for (size_t i = 0; i < count; ++i) {
      const Eigen::Vector4d local(double(positions[i * 3]), double(positions[i * 3 + 1]),
                                  double(positions[i * 3 + 2]), 1.0);
      const Eigen::Vector4d world = matrix * local;
      for (int axis = 0; axis < 3; ++axis) {
        mesh_.positions.push_back(static_cast<float>(world[axis]));
      }
    }
    for (const uint32_t corner : corners) {
      mesh_.triangles.push_back(static_cast<uint32_t>(first + corner));
    }
    addNormals(primitive, matrix, corners, count, what);
    addColours(primitive, corners, count, what);
    const MaterialUse use =
        materials_.use(primitive.material, attributeOf(primitive, "COLOR_0") >= 0);
    addUvs(primitive, use, corners, count, what);
    mesh_.triangle_materials.insert(mesh_.triangle_materials.end(), corners.size() / 3,
                                    use.material);
  }

  void addNormals(const tinygltf::Primitive& primitive, const Mat4d& matrix,
                  const std::vector<uint32_t>& corners, size_t count, const std::string& what) {
    const int accessor = attributeOf(primitive, "NORMAL");
    if (accessor < 0) {
      mesh_.corner_normals.resize(mesh_.corner_normals.size() + corners.size() * 3, 0.0f);
      return;
    }
    any_normals_ = true;
    requireCount(accessor, count, what + ", NORMAL");
    const std::vector<float> normals = readFloats(model_, accessor, 3, what + ", NORMAL");
    const Mat3d linear = matrix.topLeftCorner<3, 3>();
    // The cofactor matrix is the inverse transpose up to a factor, and exists for flat scales too.
    Mat3d cofactor;
    cofactor.col(0) = linear.col(1).cross(linear.col(2));
    cofactor.col(1) = linear.col(2).cross(linear.col(0));
    cofactor.col(2) = linear.col(0).cross(linear.col(1));
    if (linear.determinant() < 0) cofactor = -cofactor;
    for (const uint32_t corner : corners) {
      const Vec3d normal = cofactor * Vec3d(double(normals[corner * size_t{3}]),
                                            double(normals[corner * size_t{3} + 1]),
                                            double(normals[corner * size_t{3} + 2]));
      const double length = normal.norm();
      // Left at zero, the face's normal is put in at the end.
      const bool usable = std::isfinite(length) && length > 0;
      for (int axis = 0; axis < 3; ++axis) {
        mesh_.corner_normals.push_back(usable ? static_cast<float>(normal[axis] / length) : 0.0f);
      }
    }
  }

  void addColours(const tinygltf::Primitive& primitive, const std::vector<uint32_t>& corners,
                  size_t count, const std::string& what) {
    const int accessor = attributeOf(primitive, "COLOR_0");
    if (accessor < 0) {
      mesh_.corner_colours.resize(mesh_.corner_colours.size() + corners.size() * 4, 1.0f);
      return;
    }
    any_colours_ = true;
    const size_t width = accessorWidth(model_, accessor, what + ", COLOR_0") == 3 ? 3 : 4;
    requireCount(accessor, count, what + ", COLOR_0");
    const std::vector<float> colours = readFloats(model_, accessor, width, what + ", COLOR_0");
    requireFiniteHere(colours, width, what + ", COLOR_0");
    for (const uint32_t corner : corners) {
      float rgba[4] = {1, 1, 1, 1};
      std::copy_n(&colours[corner * width], width, rgba);
      materials_.shade(primitive.material, rgba);
      mesh_.corner_colours.insert(mesh_.corner_colours.end(), rgba, rgba + 4);
    }
  }

  void addUvs(const tinygltf::Primitive& primitive, const MaterialUse& use,
              const std::vector<uint32_t>& corners, size_t count, const std::string& what) {
    if (!use.needs_uvs) {
      mesh_.corner_uvs.resize(mesh_.corner_uvs.size() + corners.size() * 2, 0.0f);
      return;
    }
    any_uvs_ = true;
    const std::string name = "TEXCOORD_" + std::to_string(use.uv_set);
    const int accessor = attributeOf(primitive, name);
    if (accessor < 0) {
      fail(ErrorCode::kFormat, what + " has a textured material but no " + name);
    }
    requireCount(accessor, count, what + ", " + name);
    const std::vector<float> uvs = readFloats(model_, accessor, 2, what + ", " + name);
    requireFiniteHere(uvs, 2, what + ", " + name);
    const double* m = use.uv_matrix;
    for (const uint32_t corner : corners) {
      const double u = double(uvs[corner * size_t{2}]);
      const double v = double(uvs[corner * size_t{2} + 1]);
      mesh_.corner_uvs.push_back(static_cast<float>(m[0] * u + m[1] * v + m[2]));
      // v = 0 is the top of the picture in glTF and its bottom here.
      mesh_.corner_uvs.push_back(static_cast<float>(1.0 - (m[3] * u + m[4] * v + m[5])));
    }
  }

  /// Before anything is allocated for the accessor.
  void requireCount(int accessor, size_t expected, const std::string& what) const {
    const size_t seen = accessorCount(model_, accessor, what);
    if (seen != expected) {
      fail(ErrorCode::kFormat, what + " has " + std::to_string(seen) + " elements; " +
                                   std::to_string(expected) + " vertices need one each");
    }
  }

  static void requireFiniteHere(const std::vector<float>& values, size_t width,
                                const std::string& what) {
    try {
      requireFinite(values.data(), values.size(), width, (what + " of vertex").c_str());
    } catch (const Error& error) {
      fail(ErrorCode::kFormat, error.what());
    }
  }

  /// Corners without a normal of their own get that of their triangle.
  void finishNormals() {
    if (!any_normals_) {
      mesh_.corner_normals.clear();
      return;
    }
    const auto vertex = [this](size_t corner) {
      const float* p = &mesh_.positions[mesh_.triangles[corner] * size_t{3}];
      return Vec3d(double(p[0]), double(p[1]), double(p[2]));
    };
    for (size_t corner = 0; corner < mesh_.triangles.size(); ++corner) {
      float* normal = &mesh_.corner_normals[corner * 3];
      if (normal[0] != 0 || normal[1] != 0 || normal[2] != 0) continue;
      const size_t t = corner / 3 * 3;
      Vec3d face = (vertex(t + 1) - vertex(t)).cross(vertex(t + 2) - vertex(t));
      // A triangle without area has no direction; up is as good as any.
      if (!(face.norm() > 0)) face = Vec3d(0, 0, 1);
      face.normalize();
      for (int axis = 0; axis < 3; ++axis) normal[axis] = static_cast<float>(face[axis]);
    }
  }

  std::string path_;
  GltfScene scene_;
  const GltfModel& model_;
  TriMesh mesh_;
  MaterialReader materials_;
  bool any_normals_ = false;
  bool any_uvs_ = false;
  bool any_colours_ = false;
};

}  // namespace

TriMesh readGltf(const std::string& path) {
  return GltfReader(path).read();
}

}  // namespace stipple::media
