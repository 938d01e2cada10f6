// Based on: Jung, Kim et al., Mesh Density Adaptation for Template-based Shape Reconstruction,
// SIGGRAPH 2023. Differs: every vertex gathers what acts on it from its own triangles, so that sums
// have one order.
#include "mesh/adapt/density_energy.h"

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kVertexGrain = 2048;
/// Added to a length that is divided by: edges of unit meshes are far longer, and one of length 0
/// has no direction.
constexpr double kNoLength = 1e-12;

Vec3d unit(const Vec3d& edge) {
  return edge / (edge.norm() + kNoLength);
}

}  // namespace

VertexLengths vertexLengths(const MeshLinks& links, std::span<const Vec3d> positions) {
  VertexLengths made;
  made.lengths.resize(links.vertexCount());
  const std::span<const uint32_t> triangles = links.triangles();
  parallelFor(made.lengths.size(), kVertexGrain, [&](size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v) {
      double sum = 0;
      for (const uint32_t corner : links.corners(v)) {
        const size_t first = corner / 3 * 3;
        sum += (positions[triangles[first + (corner + 1) % 3]] -
                positions[triangles[first + (corner + 2) % 3]])
                   .norm();
      }
      made.lengths[v] = sum / 3;
    }
  });
  for (const double length : made.lengths) made.mean += length;
  if (!made.lengths.empty()) made.mean /= static_cast<double>(made.lengths.size());
  return made;
}

double densityEnergy(const VertexLengths& lengths, std::span<const double> goals) {
  if (!(lengths.mean > 0)) return 0;
  double sum = 0;
  for (size_t v = 0; v < goals.size(); ++v) {
    const double over = lengths.lengths[v] - goals[v];
    sum += over * over;
  }
  return sum / (static_cast<double>(goals.size()) * lengths.mean);
}

void addDensityGradient(const MeshLinks& links, std::span<const Vec3d> positions,
                        const VertexLengths& lengths, std::span<const double> goals, double weight,
                        std::span<Vec3d> gradient) {
  if (!(lengths.mean > 0)) return;
  const std::span<const uint32_t> triangles = links.triangles();
  // 2 / (n mean) of the square, 1 / 3 of the length.
  const double factor = weight * 2 / (3 * static_cast<double>(links.vertexCount()) * lengths.mean);
  parallelFor(links.vertexCount(), kVertexGrain, [&](size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v) {
      Vec3d sum = Vec3d::Zero();
      for (const uint32_t corner : links.corners(v)) {
        const size_t first = corner / 3 * 3;
        const uint32_t b = triangles[first + (corner + 1) % 3];
        const uint32_t c = triangles[first + (corner + 2) % 3];
        // The edge to b is opposite to c, and the other way round.
        sum += (lengths.lengths[c] - goals[c]) * unit(positions[v] - positions[b]) +
               (lengths.lengths[b] - goals[b]) * unit(positions[v] - positions[c]);
      }
      gradient[v] += factor * sum;
    }
  });
}

}  // namespace stipple
