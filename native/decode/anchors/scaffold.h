#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "nn/mlp.h"

namespace stipple {

constexpr size_t kScaffoldFeatures = 32;  ///< numbers that an anchor keeps for the networks
constexpr size_t kScaffoldScales = 6;     ///< of the offsets (3), then of the splats (3)

/// What is known of each of A anchors. The first P rows are a budget, where one was learned.
struct AnchorArrays {
  std::vector<float> positions;   ///< [A,3] metres
  std::vector<float> features;    ///< [A,kScaffoldFeatures]
  std::vector<float> log_scales;  ///< [A,kScaffoldScales] logarithms of metres
  std::vector<float> offsets;     ///< [A,K,3] of centres, in units of the first three scales

  size_t size() const { return log_scales.size() / kScaffoldScales; }
};

/// Anchors with features, and three small networks that say what the K splats of an anchor look
/// like. Of a model, the first P anchors are the budget P. Positions do not learn.
/// Based on: Lu et al., Scaffold-GS, CVPR 2024. Differs: docs/methods/anchors.md.
struct ScaffoldParameters : AnchorArrays {
  uint32_t gaussians = 10;  ///< K, 1..32
  int sh_degree = 0;        ///< 0..kMaxShDegree
  ColourSpace colour_space = ColourSpace::kDisplay;
  Antialias antialias = Antialias::kClassic;
  /// Splats of P of A anchors are (A / P)^coarsening as large, so that fewer cover as much. 0 where
  /// no smaller budget was learned.
  double coarsening = 0;

  Mlp opacity;     ///< to [K]: tanh; splats that are not above 0 are not there
  Mlp covariance;  ///< to [K,7]: shares of the last three scales by a logistic, a quaternion
  Mlp colour;      ///< to [K,3] by a logistic, then [K,(degree+1)^2-1,3] higher harmonics

  size_t higherCoefficients() const { return (shCoefficientCount(sh_degree) - 1) * 3; }
  uint64_t bytes() const;
};

/// What a scaffold begins with.
struct ScaffoldShape {
  uint32_t gaussians = 10;
  int sh_degree = 0;
  ColourSpace colour_space = ColourSpace::kDisplay;
  Antialias antialias = Antialias::kClassic;
  uint64_t seed = 0;  ///< of the networks' weights
  double coarsening = 0;
};

/// Without anchors. Errors: kInvalidArgument for a shape out of range.
ScaffoldParameters makeScaffold(const ScaffoldShape& shape);

/// Adds an anchor that knows nothing: features and offsets of 0, scales of one length.
/// In: position [3], feature [kScaffoldFeatures] or null: 0; length > 0, metres.
void addAnchor(ScaffoldParameters& scaffold, const float* position, const float* feature,
               float length);

/// The length of a logarithm, which is held to +-30 (10^13 metres and 10^-13), so that nothing
/// overflows; and whether a change of it changes the length.
float lengthOfLog(float value);
bool isFreeLog(float value);

/// Keeps the rows of anchors that are listed, in that order.
void keepAnchors(ScaffoldParameters& scaffold, const std::vector<uint32_t>& rows);

/// Refuses parts that do not fit together or are not finite, for scaffolds from a file.
/// Errors: kFormat.
void validate(const ScaffoldParameters& scaffold);

}  // namespace stipple
