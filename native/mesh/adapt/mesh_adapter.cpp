// Based on: Jung, Kim et al., Mesh Density Adaptation for Template-based Shape Reconstruction,
// SIGGRAPH 2023 (energies, schedule); Nicolet, Jacobson, Jakob, Large Steps in Inverse Rendering of
// Geometry, SIGGRAPH Asia 2021 (u = M x). Differs: all is in double precision; the optimiser begins
// anew with each phase, since the moments of a strong energy that has gone would hold the next one
// up, and its step size falls at the end.
#include "mesh/adapt/mesh_adapter.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"

namespace stipple {

namespace {

constexpr double kMostStrength = 1e6;
constexpr uint32_t kMostSteps = 1000000;

void requireRange(double value, const char* name) {
  if (std::isfinite(value) && value >= 0 && value <= kMostStrength) return;
  fail(ErrorCode::kInvalidArgument,
       std::string(name) + " is " + std::to_string(value) + "; 0 to 1000000 is allowed");
}

const MeshAdapterOptions& validated(const MeshAdapterOptions& options) {
  validate(options);
  return options;
}

}  // namespace

void validate(const MeshAdapterOptions& options) {
  requireRange(options.strength, "strength of the density");
  requireRange(options.adaptive_factor, "adaptive factor of the density");
  if (!(options.shortest >= 0 && options.shortest <= 1)) {
    fail(ErrorCode::kInvalidArgument, "shortest length is " + std::to_string(options.shortest) +
                                          " of the mean; 0 to 1 is allowed");
  }
  if (!(options.last_share >= 0 && options.last_share <= 1)) {
    fail(ErrorCode::kInvalidArgument, "last share is " + std::to_string(options.last_share) +
                                          " of the step size; 0 to 1 is allowed");
  }
  requireRange(options.smoothness, "smoothness");
  requireRange(options.laplacian, "weight of the Laplacian penalty");
  if (!(std::isfinite(options.step_size) && options.step_size > 0 && options.step_size <= 10)) {
    fail(ErrorCode::kInvalidArgument, "step size is " + std::to_string(options.step_size) +
                                          "; more than 0 and at most 10 is allowed");
  }
  if (options.steps < 1 || options.steps > kMostSteps) {
    fail(ErrorCode::kInvalidArgument,
         "steps are " + std::to_string(options.steps) + "; 1 to 1000000 are allowed");
  }
}

DensityPhase densityPhase(const MeshAdapterOptions& options, uint32_t step) {
  const uint64_t fifths = uint64_t{step} * 5 / options.steps;
  const bool first = fifths < 1;
  if (options.density == MeshDensity::kOff || fifths >= 2) return {};
  if (first || options.density == MeshDensity::kUniform) {
    return {MeshDensity::kUniform, options.strength};
  }
  return {MeshDensity::kAdaptive, options.strength * options.adaptive_factor};
}

double stepShare(const MeshAdapterOptions& options, uint32_t step) {
  const uint32_t begin = options.steps - options.steps / 10;
  if (step < begin) return 1.0;
  const double done = static_cast<double>(step - begin) / std::max(options.steps - begin, 1u);
  return 1.0 - (1.0 - options.last_share) * std::min(done, 1.0);
}

MeshAdapter::MeshAdapter(const MeshLinks& links, std::span<const Vec3d> positions,
                         const MeshAdapterOptions& options)
    : links_(links),
      options_(validated(options)),
      diffusion_(links, 1.0, options.smoothness),
      complexity_(links),
      optimiser_(links.vertexCount(), options.step_size),
      positions_(positions.begin(), positions.end()),
      spread_(positions_) {
  diffusion_.multiply(spread_);
}

double MeshAdapter::step(std::span<Vec3d> gradient) {
  const double energy = addDensity(densityPhase(options_, step_), gradient);
  if (options_.laplacian > 0) addLaplacian(gradient);
  if (step_ > 0 && densityPhase(options_, step_ - 1).goal != densityPhase(options_, step_).goal) {
    optimiser_ = AdamUniform(links_.vertexCount(), options_.step_size);
  }
  diffusion_.solve(gradient);
  optimiser_.step(spread_, gradient, stepShare(options_, step_));
  std::copy(spread_.begin(), spread_.end(), positions_.begin());
  diffusion_.solve(std::span<Vec3d>(positions_));
  ++step_;
  return energy;
}

double MeshAdapter::addDensity(const DensityPhase& phase, std::span<Vec3d> gradient) {
  if (phase.goal == MeshDensity::kOff || phase.weight == 0) return 0;
  const VertexLengths lengths = vertexLengths(links_, positions_);
  const std::vector<double> goals = phase.goal == MeshDensity::kUniform
                                        ? std::vector<double>(positions_.size(), lengths.mean)
                                        : complexity_.goals(positions_, lengths, options_.shortest);
  addDensityGradient(links_, positions_, lengths, goals, phase.weight, gradient);
  return phase.weight * densityEnergy(lengths, goals);
}

void MeshAdapter::addLaplacian(std::span<Vec3d> gradient) const {
  std::vector<Vec3d> once(positions_.size()), twice(positions_.size());
  laplacian(links_, positions_, once);
  laplacian(links_, once, twice);
  const double factor = 2 * options_.laplacian / static_cast<double>(positions_.size());
  for (size_t v = 0; v < twice.size(); ++v) gradient[v] += factor * twice[v];
}

uint64_t meshAdapterMemoryBound(uint64_t vertex_count, uint64_t triangle_count) {
  // Entries of a factor with a fill-reducing order grow like n log n on a surface; 16 bytes each,
  // and the two factors are made one after the other from a matrix of less.
  constexpr double kEntriesPerVertex = 8, kEntryBytes = 16, kFactors = 2;
  constexpr uint64_t kVertexBytes = 600, kTriangleBytes = 60;
  const double logarithm = std::log2(static_cast<double>(std::max<uint64_t>(vertex_count, 2)));
  const double factors = kFactors * kEntryBytes * kEntriesPerVertex * logarithm;
  return static_cast<uint64_t>(factors * static_cast<double>(vertex_count)) +
         vertex_count * kVertexBytes + triangle_count * kTriangleBytes;
}

}  // namespace stipple
