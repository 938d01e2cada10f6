#include "mesh/mesh_image.h"

#include <algorithm>
#include <array>
#include <bit>
#include <string>
#include <vector>

#include "base/atomic_ref.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "math/affine.h"
#include "math/colour.h"
#include "mesh/triangle_raster.h"

namespace stipple {

namespace {

constexpr uint32_t kMostSamples = 16;
constexpr size_t kTrianglesAtOnce = 1 << 11;
constexpr uint64_t kNothing = UINT64_MAX;

/// Depth, then number of the nearest triangle of every ray: positive floats are ordered like their
/// bits, and of two triangles at one depth the first is seen.
uint64_t keyOf(double z, size_t triangle) {
  return uint64_t{std::bit_cast<uint32_t>(static_cast<float>(z))} << 32 |
         static_cast<uint32_t>(triangle);
}

void keepNearest(uint64_t& place, uint64_t key) {
  const AtomicRef<uint64_t> here(place);
  uint64_t seen = here.load(std::memory_order_relaxed);
  while (key < seen && !here.compare_exchange_weak(seen, key, std::memory_order_relaxed)) {
  }
}

Barycentric placeOf(const Vec3d& weights) {
  return {weights.x(), weights.y(), weights.z()};
}

struct MeshView {
  const TriMesh& mesh;
  const SurfaceColour& colour;
  const Camera& camera;  ///< of the rays
  std::vector<Vec3d> vertices;

  std::array<Vec3d, 3> corners(size_t triangle) const {
    const uint32_t* corner = &mesh.triangles[triangle * 3];
    return {vertices[corner[0]], vertices[corner[1]], vertices[corner[2]]};
  }
};

std::array<float, 4> colourOf(const MeshView& view, size_t triangle, const Vec3d& weights) {
  if (!view.colour.changesWithView(triangle)) {
    return view.colour.at(triangle, placeOf(weights), 0.0, 0);
  }
  const std::array<Vec3d, 3> c = view.corners(triangle);
  // From the eye to the place, in the camera, turned into the world.
  const Vec3d place = weights.x() * c[0] + weights.y() * c[1] + weights.z() * c[2];
  const Vec3d direction = linearPart(view.camera.world_to_camera).transpose() * place.normalized();
  return view.colour.seenAlong(
      {static_cast<float>(direction.x()), static_cast<float>(direction.y()),
       static_cast<float>(direction.z())},
      triangle, placeOf(weights));
}

void drawTriangles(const MeshView& view, std::vector<uint64_t>& nearest, Progress* progress) {
  const TriangleRaster raster(view.camera);
  const size_t width = view.camera.width;
  parallelFor(view.mesh.triangleCount(), kTrianglesAtOnce, [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    for (size_t t = begin; t < end; ++t) {
      const std::array<Vec3d, 3> c = view.corners(t);
      const bool lets_through = view.colour.mayBeTransparent(t);
      raster.draw({c[0], c[1], c[2]}, [&](uint32_t x, uint32_t y, double z, const Vec3d& weights) {
        const size_t ray = y * width + x;
        if (lets_through) {
          const float opacity = view.colour.at(t, placeOf(weights), 0.0, 0)[3];
          if (unitFloat(keyedBits(t, RandomUse::kSeeThrough, ray)) >= opacity) return;
        }
        keepNearest(nearest[ray], keyOf(z, t));
      });
    }
  });
}

/// Sum of the colours of the rays of one pixel, and how many of them met anything.
std::array<double, 4> gathered(const MeshView& view, const TriangleRaster& raster,
                               const std::vector<uint64_t>& nearest, uint32_t column, uint32_t row,
                               uint32_t samples) {
  std::array<double, 4> sum = {0, 0, 0, 0};
  uint64_t flat_of = kNothing;
  FlatTriangle flat;
  for (uint32_t y = row * samples; y < (row + 1) * samples; ++y) {
    for (uint32_t x = column * samples; x < (column + 1) * samples; ++x) {
      const uint64_t key = nearest[size_t{y} * view.camera.width + x];
      if (key == kNothing) continue;
      const auto triangle = static_cast<uint32_t>(key);
      if (flat_of != triangle) {
        const std::array<Vec3d, 3> c = view.corners(triangle);
        raster.flatten({c[0], c[1], c[2]}, flat);
        flat_of = triangle;
      }
      double z = 0;
      Vec3d weights(1, 0, 0);
      raster.meet(flat, x, y, z, weights);
      const std::array<float, 4> colour = colourOf(view, triangle, weights);
      for (size_t c = 0; c < 3; ++c) sum[c] += static_cast<double>(colour[c]);
      sum[3] += 1;
    }
  }
  return sum;
}

}  // namespace

void drawMeshImage(const TriMesh& mesh, const SurfaceColour& colour, const Camera& camera,
                   uint32_t samples, std::span<float> rgba, Progress* progress) {
  validate(camera);
  requireImagePlane(camera, "the image of a mesh");
  if (samples == 0 || samples > kMostSamples) {
    fail(ErrorCode::kInvalidArgument,
         "samples is " + std::to_string(samples) + "; 1 to 16 is allowed");
  }
  const size_t pixel_count = size_t{camera.width} * camera.height;
  if (rgba.size() != pixel_count * 4) {
    fail(ErrorCode::kInvalidArgument, "the image has room for " + std::to_string(rgba.size() / 4) +
                                          " pixels; the camera has " + std::to_string(pixel_count));
  }
  const Camera rays = enlarged(camera, samples);
  MeshView view{mesh, colour, rays, {}};
  placeVertices(mesh, camera.world_to_camera, view.vertices);
  std::vector<uint64_t> nearest(size_t{rays.width} * rays.height, kNothing);
  drawTriangles(view, nearest, progress);
  const TriangleRaster raster(rays);
  parallelFor(camera.height, 4, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y) {
      for (uint32_t x = 0; x < camera.width; ++x) {
        const std::array<double, 4> sum =
            gathered(view, raster, nearest, x, static_cast<uint32_t>(y), samples);
        float* pixel = &rgba[(y * camera.width + x) * 4];
        const double alpha = sum[3] / (static_cast<double>(samples) * samples);
        for (size_t c = 0; c < 3; ++c) {
          pixel[c] = sum[3] > 0 ? static_cast<float>(alpha * linearToSrgb(sum[c] / sum[3])) : 0.0f;
        }
        pixel[3] = static_cast<float>(alpha);
      }
    }
  });
}

uint64_t meshImageMemoryBound(const TriMesh& mesh, const Camera& camera, uint32_t samples) {
  const uint64_t rays = uint64_t{camera.width} * camera.height * samples * samples;
  return rays * sizeof(uint64_t) + mesh.vertexCount() * sizeof(Vec3d);
}

}  // namespace stipple
