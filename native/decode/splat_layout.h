#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "density/octree_density.h"

namespace stipple {

/// How the outputs of a network become the K Gaussians of an anchor, as DeG lays them out:
/// [3K centre | 3K colour | 3K scale | 4K rotation | K opacity | K spread], and behind it, where
/// colour depends on the view, [K, harmonics above the first, 3]. Gaussian-major within each.
struct SplatLayout {
  uint32_t gaussians = 4;  ///< K, 4..32
  int sh_degree = 0;       ///< 0..kMaxShDegree

  size_t higherCoefficients() const { return (shCoefficientCount(sh_degree) - 1) * 3; }
  size_t outputs() const { return gaussians * (15 + higherCoefficients()); }
  size_t centre(size_t k) const { return 3 * k; }
  size_t colour(size_t k) const { return 3 * (gaussians + k); }
  size_t scale(size_t k) const { return 3 * (2 * gaussians + k); }
  size_t rotation(size_t k) const { return 9 * gaussians + 4 * k; }
  size_t opacity(size_t k) const { return 13 * gaussians + k; }
  size_t spread(size_t k) const { return 14 * gaussians + k; }
  size_t higher(size_t k) const { return 15 * gaussians + higherCoefficients() * k; }
};

/// Side of the lattice that the Gaussians of an anchor fill where all outputs are 0, and their
/// standard deviation then, in DeG's unit cube; both are multiplied by an anchor's unit.
constexpr double kLatticeSide = 0.05;
constexpr double kLatticeScale = 0.004;

/// Anchors as the layout reads them.
struct LayoutAnchors {
  std::span<const float> positions;  ///< [P,3] in the unit cube
  std::span<const float> units;      ///< [P] > 0, lengths as multiples of DeG's
};

/// What a network was trained to have added to its outputs, where its file says so; it may be
/// rounded.
struct SplatBiases {
  std::span<const float> lattice;  ///< [K,3] to raw centres
  float spread = 0;                ///< to raw spreads
};

/// Those of zeros, which networks that are trained here have: raw centres of 0 give a Hammersley
/// lattice. In: K. Returns [K,3].
std::vector<float> usualLattice(uint32_t gaussians);
float usualSpread();

/// Places and sizes in the unit cube, which decoders turn into the world.
/// In: raw: P rows of `stride` floats, the outputs first. Out: cloud: P * K splats, anchor-major;
/// frame and flags stay. In: biases: null for those of zeros that fill the lattice.
/// Threads and determinism: anchors in parallel, independent.
/// Source: DeG (arXiv 2605.16355), attribute decoder. Differs: lengths have a unit per anchor, any
/// K, harmonics; quaternions are unit.
void activateSplats(const SplatLayout& layout, const LayoutAnchors& anchors, const float* raw,
                    size_t stride, SplatCloud& cloud, const SplatBiases* biases = nullptr);

/// Derivatives by the outputs. In: what activateSplats got and gave; gradient: by the values of
/// the cloud, in the unit cube too. Out: raw_gradient, P rows of `stride`; other columns stay.
void activateSplatsBackward(const SplatLayout& layout, const LayoutAnchors& anchors,
                            const float* raw, size_t stride, const SplatCloud& cloud,
                            const SplatCloud& gradient, float* raw_gradient);

}  // namespace stipple
