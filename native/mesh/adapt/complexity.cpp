// Based on: Jung, Kim et al., Mesh Density Adaptation for Template-based Shape Reconstruction,
// SIGGRAPH 2023. Differs: the vertices of all boundary loops, and of edges with more than two
// triangles, have no complexity (the released code leaves out the longest loop only): what is large
// in L x there is the missing half of the ring.
#include "mesh/adapt/complexity.h"

#include <algorithm>

namespace stipple {

namespace {

constexpr double kStay = 0.5, kSpread = 0.5;
constexpr int kSmoothings = 3;
/// Of unit meshes: below this mean, what L x has is rounding, as on a plane.
constexpr double kNoComplexity = 1e-12;

}  // namespace

Complexity::Complexity(const MeshLinks& links) : links_(links), smoothing_(links, kStay, kSpread) {}

std::vector<double> Complexity::values(std::span<const Vec3d> positions,
                                       const VertexLengths& lengths) const {
  std::vector<double> values(positions.size(), 1.0);
  if (!(lengths.mean > 0)) return values;
  std::vector<Vec3d> bends(positions.size());
  laplacian(links_, positions, bends);
  for (size_t v = 0; v < values.size(); ++v) {
    values[v] = links_.isBorder(v) ? 0.0 : bends[v].norm() / lengths.mean;
  }
  for (int i = 0; i < kSmoothings; ++i) smoothing_.solve(std::span<double>(values));
  double mean = 0;
  for (const double value : values) mean += value;
  mean /= static_cast<double>(values.size());
  if (!(mean > kNoComplexity)) {
    std::fill(values.begin(), values.end(), 1.0);
    return values;
  }
  for (double& value : values) value /= mean;
  return values;
}

std::vector<double> Complexity::goals(std::span<const Vec3d> positions,
                                      const VertexLengths& lengths, double shortest) const {
  std::vector<double> goals = values(positions, lengths);
  const double least = shortest * lengths.mean;
  for (size_t v = 0; v < goals.size(); ++v) {
    const double present = lengths.lengths[v];
    goals[v] = std::min(present, std::max(present / std::max(1.0, goals[v]), least));
  }
  return goals;
}

}  // namespace stipple
