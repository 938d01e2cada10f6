#pragma once

#include <span>
#include <vector>

#include "math/vec.h"
#include "mesh/adapt/mesh_links.h"

namespace stipple {

/// How long the edges around each vertex are: a third of the perimeter of its ring,
/// m_i = 1/3 * sum over the triangles at i of the length of the edge opposite to i. For n edges of
/// length e in an even fan it is n e / 3.
struct VertexLengths {
  std::vector<double> lengths;  ///< [n] m_i
  double mean = 0;              ///< of them
};

/// In: positions [n]. Threads and determinism: parallel; same result for any number of threads.
VertexLengths vertexLengths(const MeshLinks& links, std::span<const Vec3d> positions);

/// E = 1/n * sum_i (m_i - goal_i)^2 / mean. With the mean as every goal it is the uniform energy,
/// with the goals of complexityGoals() the adaptive one; it has the unit of a length. In: goals
/// [n]. 0 where the mesh has no length at all.
double densityEnergy(const VertexLengths& lengths, std::span<const double> goals);

/// Adds weight times the derivative of densityEnergy() by the positions, mean and goals being
/// constants, to `gradient` [n]. Edges without length pull nowhere. Threads and determinism:
/// parallel; same result for any number of threads.
/// Source: Jung, Kim et al., Mesh Density Adaptation for Template-based Shape Reconstruction,
/// SIGGRAPH 2023.
void addDensityGradient(const MeshLinks& links, std::span<const Vec3d> positions,
                        const VertexLengths& lengths, std::span<const double> goals, double weight,
                        std::span<Vec3d> gradient);

}  // namespace stipple
