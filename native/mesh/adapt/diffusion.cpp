// Based on: Nicolet, Jacobson, Jakob, Large Steps in Inverse Rendering of Geometry, SIGGRAPH Asia
// 2021. Differs: the factor is one of double precision on the host, by Eigen.
#include "mesh/adapt/diffusion.h"

#include <Eigen/SparseCholesky>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kVertexGrain = 4096;

using Sparse = Eigen::SparseMatrix<double>;

/// The lower half of the matrix, column by column.
Sparse lowerHalf(const MeshLinks& links, double stay, double spread) {
  const auto n = static_cast<Eigen::Index>(links.vertexCount());
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(links.vertexCount() * 4);
  for (size_t v = 0; v < links.vertexCount(); ++v) {
    const auto column = static_cast<int>(v);
    const std::span<const uint32_t> neighbours = links.neighbours(v);
    entries.emplace_back(column, column, stay + spread * static_cast<double>(neighbours.size()));
    for (const uint32_t other : neighbours) {
      if (other > v) entries.emplace_back(static_cast<int>(other), column, -spread);
    }
  }
  Sparse matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

}  // namespace

void laplacian(const MeshLinks& links, std::span<const Vec3d> values, std::span<Vec3d> out) {
  parallelFor(values.size(), kVertexGrain, [&](size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v) {
      Vec3d sum = Vec3d::Zero();
      for (const uint32_t other : links.neighbours(v)) sum += values[v] - values[other];
      out[v] = sum;
    }
  });
}

struct Diffusion::Factor {
  Eigen::SimplicialLDLT<Sparse, Eigen::Lower> cholesky;
};

Diffusion::Diffusion(const MeshLinks& links, double stay, double spread)
    : links_(links), stay_(stay), spread_(spread) {
  auto factor = std::make_unique<Factor>();
  factor->cholesky.compute(lowerHalf(links, stay, spread));
  if (factor->cholesky.info() != Eigen::Success) {
    fail(ErrorCode::kInternal, "the diffusion of the mesh could not be factored");
  }
  factor_ = std::move(factor);
}

Diffusion::~Diffusion() = default;

void Diffusion::solve(std::span<Vec3d> values) const {
  parallelFor(3, 1, [&](size_t begin, size_t end) {
    std::vector<double> column(values.size());
    for (size_t axis = begin; axis < end; ++axis) {
      const auto row = static_cast<Eigen::Index>(axis);
      for (size_t v = 0; v < values.size(); ++v) column[v] = values[v][row];
      solve(std::span<double>(column));
      for (size_t v = 0; v < values.size(); ++v) values[v][row] = column[v];
    }
  });
}

void Diffusion::solve(std::span<double> values) const {
  Eigen::Map<Eigen::VectorXd> column(values.data(), static_cast<Eigen::Index>(values.size()));
  column = factor_->cholesky.solve(column).eval();
}

void Diffusion::multiply(std::span<Vec3d> values) const {
  std::vector<Vec3d> spread(values.size());
  laplacian(links_, values, spread);
  for (size_t v = 0; v < values.size(); ++v) values[v] = stay_ * values[v] + spread_ * spread[v];
}

}  // namespace stipple
