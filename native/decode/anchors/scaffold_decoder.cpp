// Based on: Lu, Yu, Xu, Xiangli, Wang, Lin, Dai, Scaffold-GS: Structured 3D Gaussians for
// View-Adaptive Rendering, CVPR 2024, sections 3.2 and 3.3. Differs: networks do not see the view;
// what depends on it are harmonics.
#include "decode/anchors/scaffold_decoder.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 256;
/// Shorter quaternions count as no rotation: where they point is rounding alone.
constexpr double kLeastTurn = 1e-6;

float logistic(float x) {
  const float e = std::exp(-std::abs(x));
  return x < 0 ? e / (1.0f + e) : 1.0f / (1.0f + e);
}

/// Numbers that no step can reach come from files alone. A splat of such is not seen.
void hideUnlessFinite(SplatCloud& cloud, size_t n) {
  const size_t stride = cloud.shStride();
  const auto areFinite = [](const float* values, size_t count) {
    return std::all_of(values, values + count, [](float v) { return std::isfinite(v); });
  };
  if (areFinite(&cloud.positions[n * 3], 3) && areFinite(&cloud.rotations[n * 4], 4) &&
      areFinite(&cloud.scales[n * 3], 3) && areFinite(&cloud.sh[n * stride], stride) &&
      std::isfinite(cloud.opacities[n])) {
    return;
  }
  std::fill_n(&cloud.positions[n * 3], 3, 0.0f);
  std::fill_n(&cloud.rotations[n * 4], 4, 0.0f);
  cloud.rotations[n * 4] = 1.0f;
  std::fill_n(&cloud.scales[n * 3], 3, 0.0f);
  std::fill_n(&cloud.sh[n * stride], stride, 0.0f);
  cloud.opacities[n] = 0.0f;
}

/// In double precision: squares of large numbers, which files have, are infinite in single.
double lengthOf(const float* q) {
  double sum = 0;
  for (size_t i = 0; i < 4; ++i) sum += static_cast<double>(q[i]) * static_cast<double>(q[i]);
  return std::sqrt(sum);
}

}  // namespace

SplatCloud ScaffoldDecoder::decode(const DecodeRequest& request) const {
  if (request.gaussians_per_anchor != scaffold_->gaussians) {
    fail(ErrorCode::kInvalidArgument,
         "gaussians per anchor is " + std::to_string(request.gaussians_per_anchor) +
             "; these anchors were learned with " + std::to_string(scaffold_->gaussians));
  }
  advance(request.progress, 0.0, "Decoding splats");
  SplatCloud cloud;
  ScaffoldTape tape;
  forward(*scaffold_, static_cast<size_t>(std::min<uint64_t>(request.budget, scaffold_->size())),
          tape, cloud);
  return cloud;
}

uint64_t ScaffoldDecoder::memoryBound(uint64_t anchor_count, uint32_t gaussians_per_anchor) const {
  const uint64_t splat = 11 + shCoefficientCount(scaffold_->sh_degree) * 3 + 1;
  uint64_t of_networks = 0;
  for (const Mlp* network : {&scaffold_->opacity, &scaffold_->covariance, &scaffold_->colour}) {
    for (const LinearLayer& layer : network->layers()) of_networks += 2 * layer.outputs;
  }
  return anchor_count * (of_networks + gaussians_per_anchor * splat) * sizeof(float) +
         (uint64_t{1} << 20);
}

void ScaffoldDecoder::forward(const AnchorArrays& anchors, size_t count, ScaffoldTape& tape,
                              SplatCloud& cloud) const {
  const ScaffoldParameters& scaffold = *scaffold_;
  const size_t gaussians = scaffold.gaussians;
  const std::span<const float> features = {anchors.features.data(), count * kScaffoldFeatures};
  tape.anchors = count;
  scaffold.opacity.forward(features, count, tape.opacity);
  scaffold.covariance.forward(features, count, tape.covariance);
  scaffold.colour.forward(features, count, tape.colour);
  tape.slots.clear();
  for (size_t slot = 0; slot < count * gaussians; ++slot) {
    if (tape.opacity.output()[slot] > 0) tape.slots.push_back(static_cast<uint32_t>(slot));
  }
  cloud.sh_degree = scaffold.sh_degree;
  cloud.colour_space = scaffold.colour_space;
  cloud.antialias = scaffold.antialias;
  cloud.resize(tape.slots.size());
  const size_t higher = scaffold.higherCoefficients();
  const double share = static_cast<double>(scaffold.size()) / static_cast<double>(count);
  const auto growth = static_cast<float>(std::pow(share, scaffold.coarsening));
  const float* opacities = tape.opacity.output().data();
  const float* covariances = tape.covariance.output().data();
  const float* colours = tape.colour.output().data();
  parallelFor(tape.slots.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t n = begin; n < end; ++n) {
      const size_t slot = tape.slots[n];
      const size_t anchor = slot / gaussians;
      const float* log_scales = &anchors.log_scales[anchor * kScaffoldScales];
      const float* covariance = &covariances[slot * 7];
      for (size_t axis = 0; axis < 3; ++axis) {
        cloud.positions[n * 3 + axis] =
            anchors.positions[anchor * 3 + axis] +
            anchors.offsets[slot * 3 + axis] * lengthOfLog(log_scales[axis]);
        cloud.scales[n * 3 + axis] =
            growth * (lengthOfLog(log_scales[3 + axis]) * logistic(covariance[axis]));
      }
      const double length = lengthOf(covariance + 3);
      for (size_t i = 0; i < 4; ++i) {
        cloud.rotations[n * 4 + i] =
            length < kLeastTurn
                ? (i == 0 ? 1.0f : 0.0f)
                : static_cast<float>(static_cast<double>(covariance[3 + i]) / length);
      }
      cloud.opacities[n] = std::tanh(opacities[slot]);
      const float* row = &colours[anchor * gaussians * (3 + higher)];
      const float* colour = row + (slot % gaussians) * 3;
      float* sh = &cloud.sh[n * cloud.shStride()];
      for (size_t c = 0; c < 3; ++c) sh[c] = (logistic(colour[c]) - 0.5f) / kShC0;
      std::copy_n(row + gaussians * 3 + (slot % gaussians) * higher, higher, sh + 3);
      hideUnlessFinite(cloud, n);
    }
  });
}

void ScaffoldDecoder::backward(const AnchorArrays& anchors, ScaffoldTape& tape,
                               const SplatCloud& cloud, const SplatCloud& cloud_gradient,
                               ScaffoldGradients& gradients) const {
  const ScaffoldParameters& scaffold = *scaffold_;
  const size_t gaussians = scaffold.gaussians;
  const size_t higher = scaffold.higherCoefficients();
  const size_t count = tape.anchors;
  AnchorArrays& by_anchors = gradients.anchors;
  by_anchors.positions.assign(scaffold.positions.size(), 0.0f);
  by_anchors.features.assign(scaffold.features.size(), 0.0f);
  by_anchors.log_scales.assign(scaffold.log_scales.size(), 0.0f);
  by_anchors.offsets.assign(scaffold.offsets.size(), 0.0f);
  auto& by_opacity = tape.raw_gradients[0];
  auto& by_covariance = tape.raw_gradients[1];
  auto& by_colour = tape.raw_gradients[2];
  by_opacity.assign(tape.opacity.output().size(), 0.0f);
  by_covariance.assign(tape.covariance.output().size(), 0.0f);
  by_colour.assign(tape.colour.output().size(), 0.0f);
  const float* covariances = tape.covariance.output().data();
  // Splats of an anchor stand behind each other, and add to its scales: a block holds whole
  // anchors.
  parallelFor(count, kGrain, [&](size_t first_anchor, size_t last_anchor) {
    const auto at = [&](size_t anchor) {
      return static_cast<size_t>(
          std::lower_bound(tape.slots.begin(), tape.slots.end(), anchor * gaussians) -
          tape.slots.begin());
    };
    for (size_t n = at(first_anchor); n < at(last_anchor); ++n) {
      const size_t slot = tape.slots[n];
      const size_t anchor = slot / gaussians;
      const float* log_scales = &anchors.log_scales[anchor * kScaffoldScales];
      float* by_log_scales = &by_anchors.log_scales[anchor * kScaffoldScales];
      const float* covariance = &covariances[slot * 7];
      for (size_t axis = 0; axis < 3; ++axis) {
        const float by_place = cloud_gradient.positions[n * 3 + axis];
        const float reach = lengthOfLog(log_scales[axis]);
        by_anchors.positions[anchor * 3 + axis] += by_place;
        by_anchors.offsets[slot * 3 + axis] = by_place * reach;
        if (isFreeLog(log_scales[axis]))
          by_log_scales[axis] += by_place * reach * anchors.offsets[slot * 3 + axis];
        const float by_scale =
            cloud_gradient.scales[n * 3 + axis] * cloud.scales[n * 3 + axis];  // by its logarithm
        if (isFreeLog(log_scales[3 + axis])) by_log_scales[3 + axis] += by_scale;
        by_covariance[slot * 7 + axis] = by_scale * (1 - logistic(covariance[axis]));
      }
      const double length = lengthOf(covariance + 3);
      if (length >= kLeastTurn) {
        const float* q = &cloud.rotations[n * 4];
        const float* by_q = &cloud_gradient.rotations[n * 4];
        const float along = q[0] * by_q[0] + q[1] * by_q[1] + q[2] * by_q[2] + q[3] * by_q[3];
        for (size_t i = 0; i < 4; ++i) {
          by_covariance[slot * 7 + 3 + i] =
              static_cast<float>(static_cast<double>(by_q[i] - along * q[i]) / length);
        }
      }
      const float opacity = cloud.opacities[n];
      by_opacity[slot] = cloud_gradient.opacities[n] * (1 - opacity * opacity);
      const float* by_sh = &cloud_gradient.sh[n * cloud.shStride()];
      float* row = &by_colour[anchor * gaussians * (3 + higher)];
      for (size_t c = 0; c < 3; ++c) {
        const float colour = cloud.sh[n * cloud.shStride() + c] * kShC0 + 0.5f;
        row[(slot % gaussians) * 3 + c] = by_sh[c] / kShC0 * colour * (1 - colour);
      }
      std::copy_n(by_sh + 3, higher, row + gaussians * 3 + (slot % gaussians) * higher);
    }
  });
  const std::span<const float> features = {anchors.features.data(), count * kScaffoldFeatures};
  tape.input_gradient.resize(count * kScaffoldFeatures);
  const auto through = [&](const Mlp& network, MlpTape& of, const std::vector<float>& by_raw,
                           std::vector<LinearLayer>& by_network) {
    if (by_network.empty()) by_network = network.zeros();
    network.backward(features, of, by_raw, by_network, tape.input_gradient);
    for (size_t i = 0; i < tape.input_gradient.size(); ++i) {
      by_anchors.features[i] += tape.input_gradient[i];
    }
  };
  through(scaffold.opacity, tape.opacity, by_opacity, gradients.opacity);
  through(scaffold.covariance, tape.covariance, by_covariance, gradients.covariance);
  through(scaffold.colour, tape.colour, by_colour, gradients.colour);
}

}  // namespace stipple
