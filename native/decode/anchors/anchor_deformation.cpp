// Based on: Wu et al., 4D Gaussian Splatting for Real-Time Dynamic Scene Rendering, CVPR 2024; Kwak
// et al., MoRel, CVPR 2026 (arXiv 2512.09270): of anchors, in both directions from a key frame.
// Differs: docs/methods/relay.md.
#include "decode/anchors/anchor_deformation.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 512;
constexpr size_t kHidden = 64;
/// Of the diagonal of the planes' box: how far 1 of a place's head moves an anchor.
constexpr double kReach = 0.3;

/// Where the heads begin in a row of outputs.
constexpr size_t kScalesAt = 3;
constexpr size_t kFeaturesAt = kScalesAt + kScaffoldScales;
constexpr size_t kOffsetsAt = kFeaturesAt + kScaffoldFeatures;

/// What 1 of a head is at a time.
struct HeadUnits {
  float place;   ///< metres
  float offset;  ///< in units of the anchor's lengths
  float look;    ///< of lengths, which are logarithms, and features
};

HeadUnits unitsAt(const AnchorDeformation& deformation, double tau) {
  const double moved = deformation.grows_from_key ? tau : 1.0;
  return {static_cast<float>(moved * deformation.unit), static_cast<float>(moved),
          static_cast<float>(std::abs(moved))};
}

}  // namespace

uint64_t AnchorDeformation::bytes() const {
  uint64_t floats = 0;
  for (const HexPlane& plane : planes.planes()) floats += plane.values.size();
  for (const LinearLayer& layer : heads.layers()) floats += layer.weights.size() + layer.outputs;
  return floats * sizeof(float);
}

AnchorDeformation makeDeformation(const HexPlaneShape& shape, uint32_t gaussians) {
  AnchorDeformation deformation;
  deformation.planes = HexPlanes(shape);
  const std::array<size_t, 4> widths = {deformation.planes.featureWidth(), kHidden, kHidden,
                                        kOffsetsAt + size_t{gaussians} * 3};
  deformation.heads = Mlp(widths, shape.seed, 0.0f);
  // What planes begin with is 1 on the mean. Behind the first layer it is 0, so that what the last
  // one learns moves anchors by how their places differ, and not all of them alike.
  LinearLayer& first = deformation.heads.layers().front();
  for (size_t i = 0; i < first.inputs; ++i) {
    for (size_t o = 0; o < first.outputs; ++o) {
      first.biases[o] -= first.weights[i * first.outputs + o];
    }
  }
  double squares = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    const double side = shape.highest[axis] - shape.lowest[axis];
    squares += side * side;
  }
  deformation.unit = kReach * std::sqrt(squares);
  return deformation;
}

void deform(const AnchorDeformation& deformation, const AnchorArrays& anchors, size_t count,
            double tau, DeformationTape& tape, AnchorArrays& deformed) {
  const std::span<const float> places = {anchors.positions.data(), count * 3};
  const size_t offsets = anchors.size() == 0 ? 0 : anchors.offsets.size() / anchors.size();
  tape.features.resize(count * deformation.planes.featureWidth());
  deformation.planes.forward(places, tau, tape.features, tape.planes);
  deformation.heads.forward(tape.features, count, tape.heads);
  deformed.positions.resize(count * 3);
  deformed.log_scales.resize(count * kScaffoldScales);
  deformed.features.resize(count * kScaffoldFeatures);
  deformed.offsets.resize(count * offsets);
  const float* outputs = tape.heads.output().data();
  const size_t width = kOffsetsAt + offsets;
  const HeadUnits units = unitsAt(deformation, tau);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    const auto add = [&](const std::vector<float>& from, std::vector<float>& to, size_t i,
                         size_t length, const float* by, float scale) {
      for (size_t k = 0; k < length; ++k) to[i * length + k] = from[i * length + k] + scale * by[k];
    };
    for (size_t i = begin; i < end; ++i) {
      const float* row = &outputs[i * width];
      add(anchors.positions, deformed.positions, i, 3, row, units.place);
      add(anchors.log_scales, deformed.log_scales, i, kScaffoldScales, row + kScalesAt, units.look);
      add(anchors.features, deformed.features, i, kScaffoldFeatures, row + kFeaturesAt, units.look);
      add(anchors.offsets, deformed.offsets, i, offsets, row + kOffsetsAt, units.offset);
    }
  });
}

void deformBackward(const AnchorDeformation& deformation, const AnchorArrays& anchors, size_t count,
                    const AnchorArrays& by_deformed, DeformationTape& tape,
                    DeformationGradients& gradients) {
  const std::span<const float> places = {anchors.positions.data(), count * 3};
  const size_t offsets = anchors.size() == 0 ? 0 : anchors.offsets.size() / anchors.size();
  const size_t width = kOffsetsAt + offsets;
  const HeadUnits units = unitsAt(deformation, tape.planes.tau);
  tape.head_gradient.resize(count * width);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    const auto take = [&](const std::vector<float>& from, size_t i, size_t length, float* to,
                          float scale) {
      for (size_t k = 0; k < length; ++k) to[k] = scale * from[i * length + k];
    };
    for (size_t i = begin; i < end; ++i) {
      float* row = &tape.head_gradient[i * width];
      take(by_deformed.positions, i, 3, row, units.place);
      take(by_deformed.log_scales, i, kScaffoldScales, row + kScalesAt, units.look);
      take(by_deformed.features, i, kScaffoldFeatures, row + kFeaturesAt, units.look);
      take(by_deformed.offsets, i, offsets, row + kOffsetsAt, units.offset);
    }
  });
  if (gradients.heads.empty()) gradients.heads = deformation.heads.zeros();
  gradients.planes = deformation.planes.zeros();
  tape.feature_gradient.resize(tape.features.size());
  deformation.heads.backward(tape.features, tape.heads, tape.head_gradient, gradients.heads,
                             tape.feature_gradient);
  deformation.planes.backward(places, tape.planes, tape.feature_gradient, gradients.planes);
}

}  // namespace stipple
