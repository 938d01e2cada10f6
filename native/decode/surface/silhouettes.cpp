// A silhouette is seen through many splats behind each other, each nearly edge-on: what one of them
// lets out over the surface adds up to an opaque rim. Its width grows with their thickness, with
// their widths (flat splats leave a curved surface by κ σ² / 2 at each σ) and with the low-pass of
// a pixel. Splats that lie as much deeper put the rim where the surface ends.
#include "decode/surface/silhouettes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/parallel.h"

namespace stipple {

namespace {

// Set by PSNR of silhouettes of three models at 10,000 to 500,000 splats: docs/results/surfaces.md.
constexpr float kOfThickness = 2.0f;      ///< standard deviations along the normal
constexpr float kOfWidth = 0.4f;          ///< of the smaller standard deviation across the normal
constexpr float kOfCurvature = 2.0f;      ///< of κ σ₁ σ₂
constexpr float kMostOfCurvature = 0.6f;  ///< of the smaller standard deviation
constexpr float kOtherSide = -0.3f;       ///< n·n' of sheets that face away from each other
constexpr float kMostOfDepth = 0.4f;      ///< of the way to the other side

/// How far along the normal, which may be negative, splat i is to lie deeper.
float wantedInset(const SurfaceIndex& index, const SplatShapes& shapes, size_t i) {
  const float* sigma = &shapes.sigmas[i * 3];
  const float bend = std::clamp(kOfCurvature * shapes.curvatures[i] * sigma[0] * sigma[1],
                                -kMostOfCurvature * sigma[1], kMostOfCurvature * sigma[1]);
  return index.outward * kOfWidth * sigma[1] + bend;
}

}  // namespace

void insetSplats(const SurfaceIndex& index, const SurfaceSites& sites, SplatShapes& shapes) {
  std::vector<float> insets(sites.size());
  const CellTable& cells = sites.cells[0];
  parallelFor(cells.size(), 64, [&](size_t first, size_t last) {
    std::array<uint32_t, 27> around;
    for (size_t cell = first; cell < last; ++cell) {
      const size_t cell_count = sites.neighbours(cells.code(cell), around);
      for (size_t i = cells.begin(cell); i < cells.end(cell); ++i) {
        const float* c = &shapes.centres[i * 3];
        const float* n = &shapes.normals[i * 3];
        const float wanted = wantedInset(index, shapes, i);
        const float side = wanted < 0 ? -1.0f : 1.0f;
        const float reach = 2 * shapes.sigmas[i * 3];
        float most = std::abs(wanted);
        for (size_t k = 0; k < cell_count; ++k) {
          for (size_t j = cells.begin(around[k]); j < cells.end(around[k]); ++j) {
            const float* m = &shapes.normals[j * 3];
            if (n[0] * m[0] + n[1] * m[1] + n[2] * m[2] > kOtherSide) continue;
            const float* q = &shapes.centres[j * 3];
            const float d[3] = {c[0] - q[0], c[1] - q[1], c[2] - q[2]};
            const float depth = side * (d[0] * n[0] + d[1] * n[1] + d[2] * n[2]);
            const float squared = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            if (depth <= 0 || squared - depth * depth > reach * reach) continue;
            most = std::min(most, kMostOfDepth * depth);
          }
        }
        insets[i] = side * most;
      }
    }
  });
  parallelFor(sites.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      for (size_t axis = 0; axis < 3; ++axis) {
        shapes.centres[i * 3 + axis] -= insets[i] * shapes.normals[i * 3 + axis];
      }
    }
  });
}

}  // namespace stipple
