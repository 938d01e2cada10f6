#include "decode/anchors/scaffold.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "decode/tree/tree_shape.h"

namespace stipple {

namespace {

constexpr size_t kHidden = 32;
constexpr float kMostLog = 30;
constexpr uint32_t kMostGaussians = 32;
/// Splats differ little from each other at the start, and quaternions are near 1.
constexpr float kLastLayerScale = 0.3f;
/// Opacities at the start are about tanh(0.1): 0 would leave half of the splats out.
constexpr float kStartingOpacity = 0.1f;

void requireShape(uint32_t gaussians, int sh_degree, ErrorCode code) {
  if (gaussians < 1 || gaussians > kMostGaussians) {
    fail(code, "gaussians per anchor is " + std::to_string(gaussians) + "; 1 to " +
                   std::to_string(kMostGaussians) + " is allowed");
  }
  if (sh_degree < 0 || sh_degree > kMaxShDegree) {
    fail(code, "sh_degree is " + std::to_string(sh_degree) + "; 0 to 4 is allowed");
  }
}

Mlp networkTo(size_t outputs, uint64_t seed) {
  const std::array<size_t, 3> widths = {kScaffoldFeatures, kHidden, outputs};
  return Mlp(widths, seed, kLastLayerScale);
}

}  // namespace

uint64_t ScaffoldParameters::bytes() const {
  uint64_t floats = positions.size() + features.size() + log_scales.size() + offsets.size();
  for (const Mlp* network : {&opacity, &covariance, &colour}) {
    for (const LinearLayer& layer : network->layers()) {
      floats += layer.weights.size() + layer.biases.size();
    }
  }
  return floats * sizeof(float);
}

ScaffoldParameters makeScaffold(const ScaffoldShape& shape) {
  requireShape(shape.gaussians, shape.sh_degree, ErrorCode::kInvalidArgument);
  ScaffoldParameters scaffold;
  scaffold.gaussians = shape.gaussians;
  scaffold.sh_degree = shape.sh_degree;
  scaffold.colour_space = shape.colour_space;
  scaffold.antialias = shape.antialias;
  scaffold.coarsening = shape.coarsening;
  const size_t gaussians = shape.gaussians;
  scaffold.opacity = networkTo(gaussians, shape.seed);
  scaffold.covariance = networkTo(7 * gaussians, shape.seed + 1);
  scaffold.colour = networkTo(gaussians * (3 + scaffold.higherCoefficients()), shape.seed + 2);
  std::vector<float>& opacities = scaffold.opacity.layers().back().biases;
  opacities.assign(opacities.size(), kStartingOpacity);
  for (size_t k = 0; k < gaussians; ++k) {
    scaffold.covariance.layers().back().biases[7 * k + 3] = 1.0f;  // w of the quaternion
  }
  return scaffold;
}

void addAnchor(ScaffoldParameters& scaffold, const float* position, const float* feature,
               float length) {
  scaffold.positions.insert(scaffold.positions.end(), position, position + 3);
  if (feature) {
    scaffold.features.insert(scaffold.features.end(), feature, feature + kScaffoldFeatures);
  } else {
    scaffold.features.resize(scaffold.features.size() + kScaffoldFeatures, 0.0f);
  }
  scaffold.log_scales.resize(scaffold.log_scales.size() + kScaffoldScales, std::log(length));
  scaffold.offsets.resize(scaffold.offsets.size() + size_t{scaffold.gaussians} * 3, 0.0f);
}

float lengthOfLog(float value) {
  return std::exp(std::clamp(value, -kMostLog, kMostLog));
}

bool isFreeLog(float value) {
  return std::abs(value) < kMostLog;
}

void keepAnchors(ScaffoldParameters& scaffold, const std::vector<uint32_t>& rows) {
  gatherRows(scaffold.positions, 3, rows);
  gatherRows(scaffold.features, kScaffoldFeatures, rows);
  gatherRows(scaffold.log_scales, kScaffoldScales, rows);
  gatherRows(scaffold.offsets, size_t{scaffold.gaussians} * 3, rows);
}

void validate(const ScaffoldParameters& scaffold) {
  requireShape(scaffold.gaussians, scaffold.sh_degree, ErrorCode::kFormat);
  const size_t count = scaffold.size();
  const auto require = [](const char* what, size_t seen, size_t needed) {
    if (seen == needed) return;
    fail(ErrorCode::kFormat, std::string(what) + " of the scaffold is " + std::to_string(seen) +
                                 "; " + std::to_string(needed) + " is needed");
  };
  const size_t gaussians = scaffold.gaussians;
  require("count of numbers of positions", scaffold.positions.size(), count * 3);
  require("count of numbers of features", scaffold.features.size(), count * kScaffoldFeatures);
  require("count of numbers of scales", scaffold.log_scales.size(), count * kScaffoldScales);
  require("count of numbers of offsets", scaffold.offsets.size(), count * gaussians * 3);
  const std::array<std::pair<const Mlp*, size_t>, 3> networks = {
      {{&scaffold.opacity, gaussians},
       {&scaffold.covariance, 7 * gaussians},
       {&scaffold.colour, gaussians * (3 + scaffold.higherCoefficients())}}};
  for (const auto& [network, outputs] : networks) {
    if (network->layers().empty()) {
      fail(ErrorCode::kFormat, "the scaffold lacks one of its three networks");
    }
    require("width of a network's input", network->inputWidth(), kScaffoldFeatures);
    require("width of a network's output", network->outputWidth(), outputs);
  }
  for (const std::vector<float>* values :
       {&scaffold.positions, &scaffold.features, &scaffold.log_scales, &scaffold.offsets}) {
    for (const float value : *values) {
      if (std::isfinite(value)) continue;
      fail(ErrorCode::kFormat,
           "the scaffold holds " + std::to_string(value) + "; every value must be a finite number");
    }
  }
}

}  // namespace stipple
