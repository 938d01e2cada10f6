#include "mesh/adapt/weighted_diffusion.h"

#include <Eigen/SparseCholesky>
#include <algorithm>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kVertexGrain = 4096;
constexpr uint32_t kStands = ~uint32_t{0};

using Sparse = Eigen::SparseMatrix<double>;

double weightOf(std::span<const double> weights, uint32_t a, uint32_t b) {
  return 0.5 * (weights[a] + weights[b]);
}

}  // namespace

void weightedLaplacian(const MeshLinks& links, std::span<const double> weights,
                       std::span<const Vec3d> values, std::span<Vec3d> out) {
  parallelFor(values.size(), kVertexGrain, [&](size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v) {
      Vec3d sum = Vec3d::Zero();
      for (const uint32_t other : links.neighbours(v)) {
        sum += weightOf(weights, static_cast<uint32_t>(v), other) * (values[v] - values[other]);
      }
      out[v] = sum;
    }
  });
}

struct WeightedDiffusion::Factor {
  Eigen::SimplicialLDLT<Sparse, Eigen::Lower> cholesky;
  bool is_analysed = false;  ///< the pattern, which stays
};

WeightedDiffusion::WeightedDiffusion(const MeshLinks& links, std::span<const uint8_t> moves)
    : links_(links), row_of_(moves.size(), kStands), factor_(std::make_unique<Factor>()) {
  for (uint32_t v = 0; v < moves.size(); ++v) {
    if (moves[v] == 0) continue;
    row_of_[v] = static_cast<uint32_t>(movers_.size());
    movers_.push_back(v);
  }
}

WeightedDiffusion::~WeightedDiffusion() = default;

void WeightedDiffusion::factor(std::span<const double> weights, double seconds) {
  if (movers_.empty()) return;
  const auto n = static_cast<Eigen::Index>(movers_.size());
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(movers_.size() * 4);
  for (const uint32_t v : movers_) {
    const auto column = static_cast<int>(row_of_[v]);
    double diagonal = 1 / seconds;
    for (const uint32_t other : links_.neighbours(v)) {
      const double weight = weightOf(weights, v, other);
      diagonal += weight;
      if (row_of_[other] == kStands || other < v) continue;
      entries.emplace_back(static_cast<int>(row_of_[other]), column, -weight);
    }
    entries.emplace_back(column, column, diagonal);
  }
  Sparse matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  if (!factor_->is_analysed) factor_->cholesky.analyzePattern(matrix);
  factor_->is_analysed = true;
  factor_->cholesky.factorize(matrix);
  if (factor_->cholesky.info() != Eigen::Success) {
    fail(ErrorCode::kInternal, "the diffusion of the mesh could not be factored");
  }
}

void WeightedDiffusion::solve(std::span<Vec3d> values) const {
  std::vector<Vec3d> moved(values.size(), Vec3d::Zero());
  if (!movers_.empty()) {
    parallelFor(3, 1, [&](size_t begin, size_t end) {
      Eigen::VectorXd column(static_cast<Eigen::Index>(movers_.size()));
      for (size_t axis = begin; axis < end; ++axis) {
        const auto row = static_cast<Eigen::Index>(axis);
        for (size_t i = 0; i < movers_.size(); ++i) {
          column[static_cast<Eigen::Index>(i)] = values[movers_[i]][row];
        }
        const Eigen::VectorXd solved = factor_->cholesky.solve(column);
        for (size_t i = 0; i < movers_.size(); ++i) {
          moved[movers_[i]][row] = solved[static_cast<Eigen::Index>(i)];
        }
      }
    });
  }
  std::copy(moved.begin(), moved.end(), values.begin());
}

}  // namespace stipple
