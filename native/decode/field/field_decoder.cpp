// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), attribute decoder: K Gaussians per
// anchor. Differs: features on octree levels and a small network in place of a transformer; lengths
// in units of the anchors' spacing; neighbours are an input; details are read where each Gaussian
// is.
#include "decode/field/field_decoder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "decode/anchor_spacing.h"
#include "decode/field/contraction.h"
#include "decode/field/field_details.h"
#include "decode/tree/merge_neighbours.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 512;
/// Middle and half the width of what log2 of budgets usually is.
constexpr double kMiddleBudget = 11;
constexpr double kBudgetRange = 3;
/// log2(spacing sqrt(P)) is near 0 where anchors are spread as on the faces of a cube.
constexpr double kSpacingRange = 3;
/// Neighbours farther than this, in units of the spacing, count as at it.
constexpr double kFarthest = 4;

/// Where the neighbours are: on which side more room is left, and which way the surface lies.
void writeNeighbours(const AnchorSet& anchors, size_t i, float spacing, const uint32_t* neighbours,
                     float* to) {
  std::array<double, kNeighbourInputs> sums{};
  size_t count = 0;
  for (; count < kSpacingNeighbours && neighbours[count] != kNoPlace; ++count) {
    std::array<double, 3> d;
    for (size_t axis = 0; axis < 3; ++axis) {
      const float offset =
          anchors.positions[neighbours[count] * size_t{3} + axis] - anchors.positions[i * 3 + axis];
      d[axis] = static_cast<double>(offset / spacing);
      sums[axis] += d[axis];
      sums[3 + axis] += d[axis] * d[axis];
    }
    for (size_t axis = 0; axis < 3; ++axis) sums[6 + axis] += d[axis] * d[(axis + 1) % 3];
  }
  for (const double sum : sums) {
    const double mean = sum / static_cast<double>(std::max<size_t>(count, 1));
    *to++ = static_cast<float>(std::clamp(mean, -kFarthest, kFarthest));
  }
}

/// The inputs of an anchor behind its features.
void writeInputs(const FieldParameters& field, const AnchorSet& anchors, size_t i, float spacing,
                 const uint32_t* neighbours, float* to) {
  // Of the field: a density may end above the leaves.
  const double leaves = std::ldexp(1.0, field.leaf_level);
  for (size_t axis = 0; axis < 3; ++axis) {
    const double scaled = static_cast<double>(anchors.positions[i * 3 + axis]) * leaves;
    *to++ = static_cast<float>(2 * (scaled - std::floor(scaled)) - 1);
  }
  const double count = static_cast<double>(anchors.size());
  const double budget = std::clamp(count, static_cast<double>(field.least_anchors),
                                   static_cast<double>(field.most_anchors));
  *to++ = static_cast<float>((std::log2(budget) - kMiddleBudget) / kBudgetRange);
  const double relative = std::log2(static_cast<double>(spacing) * std::sqrt(count));
  *to++ = static_cast<float>(std::clamp(relative / kSpacingRange, -2.0, 2.0));
  for (const FeatureLevel& level : field.features.levels()) {
    // How sharp a level is for this spacing: between 0 and 1, as the levels' weights are.
    const double cell = std::ldexp(1.0, -level.level);
    *to++ = static_cast<float>(cell / (cell + static_cast<double>(spacing)));
  }
  if (seesNeighbours(field)) writeNeighbours(anchors, i, spacing, neighbours, to);
}

/// Where a Gaussian would be without contraction, metres.
Vec3d placeInRoot(const FieldParameters& field, const FieldTape& tape, size_t n) {
  Vec3d place;
  for (size_t axis = 0; axis < 3; ++axis) {
    place[static_cast<int>(axis)] =
        field.root.origin[axis] + field.root.side * static_cast<double>(tape.centres[n * 3 + axis]);
  }
  return place;
}

/// From the root to the world.
void stretch(const FieldParameters& field, FieldTape& tape, SplatCloud& cloud) {
  const Contraction contraction(field.root);
  tape.stretch.resize(cloud.size());
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t n = begin; n < end; ++n) {
      const Vec3d place = placeInRoot(field, tape, n);
      tape.stretch[n] = static_cast<float>(contraction.factor(place));
      if (tape.stretch[n] == 1.0f) continue;
      const Vec3d world = contraction.toWorld(place);
      for (size_t axis = 0; axis < 3; ++axis) {
        cloud.positions[n * 3 + axis] = static_cast<float>(world[static_cast<int>(axis)]);
        cloud.scales[n * 3 + axis] *= tape.stretch[n];
      }
    }
  });
}

void stretchBackward(const FieldParameters& field, const FieldTape& tape, const SplatCloud& cloud,
                     SplatCloud& gradient) {
  const Contraction contraction(field.root);
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t n = begin; n < end; ++n) {
      if (tape.stretch[n] == 1.0f) continue;
      Vec3d by_world;
      double by_factor = 0;
      for (size_t axis = 0; axis < 3; ++axis) {
        by_world[static_cast<int>(axis)] = static_cast<double>(gradient.positions[n * 3 + axis]);
        by_factor += static_cast<double>(gradient.scales[n * 3 + axis]) *
                     static_cast<double>(cloud.scales[n * 3 + axis] / tape.stretch[n]);
        gradient.scales[n * 3 + axis] *= tape.stretch[n];
      }
      const Vec3d by = contraction.backward(placeInRoot(field, tape, n), by_world, by_factor);
      for (size_t axis = 0; axis < 3; ++axis) {
        gradient.positions[n * 3 + axis] = static_cast<float>(by[static_cast<int>(axis)]);
      }
    }
  });
}

}  // namespace

SplatCloud FieldDecoder::decode(const DecodeRequest& request) const {
  if (request.gaussians_per_anchor != field_->layout.gaussians) {
    fail(ErrorCode::kInvalidArgument,
         "gaussians per anchor is " + std::to_string(request.gaussians_per_anchor) +
             "; this field was learned for " + std::to_string(field_->layout.gaussians));
  }
  SplatCloud cloud;
  FieldTape tape;
  advance(request.progress, 0.0, "Decoding splats");
  forward(*request.anchors, tape, cloud);
  return cloud;
}

uint64_t FieldDecoder::memoryBound(uint64_t anchor_count, uint32_t gaussians_per_anchor) const {
  const uint64_t splat = (11 + 3 * shCoefficientCount(field_->layout.sh_degree)) * sizeof(float);
  // Centre, place, footprint, stretch, details.
  const uint64_t gaussian = splat + (8 + field_->details.channels()) * sizeof(float);
  // Spacing, unit, inputs; sums of every layer, and what all but the last make of them.
  uint64_t floats = 2 + fieldInputWidth(*field_);
  for (const LinearLayer& layer : field_->network.layers()) floats += 2 * layer.outputs;
  floats -= field_->network.layers().back().outputs;
  const uint64_t anchor = floats * sizeof(float) + kSpacingBytes;
  return anchor_count * (anchor + gaussians_per_anchor * gaussian) + (uint64_t{1} << 20);
}

void FieldDecoder::forward(const AnchorSet& anchors, FieldTape& tape, SplatCloud& cloud) const {
  const FieldParameters& field = *field_;
  const size_t count = anchors.size();
  const size_t width = fieldInputWidth(field);
  const size_t gaussians = field.layout.gaussians;
  tape.spacing = anchorSpacing(anchors, tape.neighbours);
  tape.units.resize(count);
  tape.footprints.resize(count * gaussians);
  tape.inputs.assign(count * width, 0.0f);
  const size_t feature_width = field.features.levels().size() * field.features.channels();
  const float share = 1.0f / std::sqrt(static_cast<float>(gaussians));
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      tape.units[i] = tape.spacing[i] / static_cast<float>(kLatticeSide);
      std::fill_n(&tape.footprints[i * gaussians], gaussians, share * tape.spacing[i]);
      writeInputs(field, anchors, i, tape.spacing[i], &tape.neighbours[i * kSpacingNeighbours],
                  &tape.inputs[i * width + feature_width]);
    }
  });
  field.features.concatenate({anchors.positions, tape.spacing}, tape.inputs.data(), width);
  field.network.forward(tape.inputs, count, tape.network);
  cloud.colour_space = field.colour_space;
  cloud.antialias = field.antialias;
  activateSplats(field.layout, {anchors.positions, tape.units}, tape.network.output().data(),
                 fieldOutputWidth(field.layout), cloud);
  tape.places.assign(cloud.positions.begin(), cloud.positions.end());
  const FieldDetails details = {field.details.channels(), tape.footprints, {}};
  tape.details.assign(cloud.size() * details.channels, 0.0f);
  field.details.addSum({tape.places, tape.footprints}, tape.details.data(), details.channels);
  addDetails(details, tape.details, cloud);
  tape.centres.assign(cloud.positions.begin(), cloud.positions.end());
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin * 3; i < end * 3; ++i) {
      cloud.positions[i] = static_cast<float>(
          field.root.origin[i % 3] + field.root.side * static_cast<double>(cloud.positions[i]));
      cloud.scales[i] *= static_cast<float>(field.root.side);
    }
  });
  tape.stretch.clear();
  if (field.contracted) stretch(field, tape, cloud);
}

void FieldDecoder::backward(const AnchorSet& anchors, FieldTape& tape, const SplatCloud& cloud,
                            SplatCloud& cloud_gradient, FieldGradients& gradients) const {
  const FieldParameters& field = *field_;
  const size_t width = fieldInputWidth(field);
  const float side = static_cast<float>(field.root.side);
  if (field.contracted) stretchBackward(field, tape, cloud, cloud_gradient);
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin * 3; i < end * 3; ++i) {
      cloud_gradient.positions[i] *= side;
      cloud_gradient.scales[i] *= side;
    }
  });
  tape.detail_gradient.resize(tape.details.size());
  addDetailsBackward({field.details.channels(), tape.footprints, tape.stretch}, tape.details, side,
                     cloud, cloud_gradient, tape.detail_gradient);
  const FeaturePlaces places = {tape.places, tape.footprints};
  const size_t channels = field.details.channels();
  field.details.backwardSum(places, tape.detail_gradient.data(), channels, gradients.details);
  field.details.addPositionGradient(places, tape.detail_gradient.data(), channels,
                                    cloud_gradient.positions);
  tape.raw_gradient.assign(tape.network.output().size(), 0.0f);
  activateSplatsBackward(field.layout, {anchors.positions, tape.units},
                         tape.network.output().data(), fieldOutputWidth(field.layout), cloud,
                         cloud_gradient, tape.raw_gradient.data());
  tape.input_gradient.resize(tape.inputs.size());
  if (gradients.network.empty()) gradients.network = field.network.zeros();
  field.network.backward(tape.inputs, tape.network, tape.raw_gradient, gradients.network,
                         tape.input_gradient);
  field.features.backwardConcatenated({anchors.positions, tape.spacing}, tape.input_gradient.data(),
                                      width, gradients.features);
}

}  // namespace stipple
