#include "mesh/mesh_depth.h"

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "base/atomic_ref.h"
#include "base/error.h"
#include "base/parallel.h"
#include "math/affine.h"
#include "mesh/triangle_raster.h"

namespace stipple {

namespace {

constexpr size_t kTrianglesAtOnce = 1 << 11;
/// Keeps what is nearest.
class DepthBuffer {
 public:
  DepthBuffer(const Camera& camera, std::span<float> depth) : width_(camera.width), depth_(depth) {}

  void put(uint32_t x, uint32_t y, double z) const {
    const float value = static_cast<float>(std::min(z, static_cast<double>(kEmptyDepth)));
    const AtomicRef<float> here(depth_[static_cast<size_t>(y) * width_ + x]);
    float seen = here.load(std::memory_order_relaxed);
    while (value < seen && !here.compare_exchange_weak(seen, value, std::memory_order_relaxed)) {
    }
  }

 private:
  uint32_t width_;
  std::span<float> depth_;
};

void drawInstance(const TriMesh& mesh, const Mat4d& object_to_camera,
                  const TriangleRaster& triangles, const DepthBuffer& nearest,
                  std::vector<Vec3d>& vertices, Progress* progress) {
  placeVertices(mesh, object_to_camera, vertices);
  const auto draw = [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    for (size_t t = begin; t < end; ++t) {
      const uint32_t* corner = &mesh.triangles[t * 3];
      triangles.draw({vertices[corner[0]], vertices[corner[1]], vertices[corner[2]]},
                     [&](uint32_t x, uint32_t y, double z, const Vec3d&) { nearest.put(x, y, z); });
    }
  };
  parallelFor(mesh.triangleCount(), kTrianglesAtOnce, std::cref(draw));
}

}  // namespace

void drawMeshDepth(std::span<const MeshInstance> instances, const Camera& camera,
                   std::span<float> depth, Progress* progress) {
  validate(camera);
  requireImagePlane(camera, "the depth of meshes");
  const size_t pixel_count = static_cast<size_t>(camera.width) * camera.height;
  if (depth.size() != pixel_count) {
    fail(ErrorCode::kInvalidArgument, "depth has room for " + std::to_string(depth.size()) +
                                          " pixels; the image has " + std::to_string(pixel_count));
  }
  for (size_t i = 0; i < instances.size(); ++i) {
    const std::string name = "instance " + std::to_string(i) + ": matrix";
    validateAffine(instances[i].object_to_world, name.c_str());
  }
  std::fill(depth.begin(), depth.end(), kEmptyDepth);
  const TriangleRaster triangles(camera);
  const DepthBuffer nearest(camera, depth);
  std::vector<Vec3d> vertices;
  for (size_t i = 0; i < instances.size(); ++i) {
    advance(progress, static_cast<double>(i) / static_cast<double>(instances.size()),
            "Drawing the depth of meshes");
    drawInstance(*instances[i].mesh, camera.world_to_camera * instances[i].object_to_world,
                 triangles, nearest, vertices, progress);
  }
}

uint64_t meshDepthMemoryBound(std::span<const MeshInstance> instances) {
  uint64_t most = 0;
  for (const MeshInstance& instance : instances) {
    most = std::max<uint64_t>(most, instance.mesh->vertexCount());
  }
  // A vector that grows from one mesh to the next holds the old and the new for a moment.
  return 2 * most * sizeof(Vec3d);
}

}  // namespace stipple
