#include "train/optimiser/field_regularisers.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "decode/anchor_spacing.h"
#include "decode/tree/merge_neighbours.h"
#include "density/anchor_cells.h"
#include "math/vec.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 512;
/// Share of the deviation within which the mean of an anchor's Gaussians may be.
constexpr double kCentred = 0.5;

Vec3d placeOf(const AnchorSet& anchors, size_t i) {
  const float* p = &anchors.positions[i * 3];
  return Vec3d(p[0], p[1], p[2]);
}

/// Whether anchors beyond the known neighbours, which are the nearest ones, may be within a radius.
bool reachesPastNeighbours(const AnchorSet& anchors, const FieldTape& tape, size_t i,
                           double radius) {
  const uint32_t farthest = tape.neighbours[i * kSpacingNeighbours + kSpacingNeighbours - 1];
  if (farthest == kNoPlace) return false;  // all there are
  return (placeOf(anchors, farthest) - placeOf(anchors, i)).norm() < radius;
}

}  // namespace

double regularise(const FieldRegularisers& weights, const FieldParameters& field,
                  const AnchorSet& anchors, const FieldTape& tape, const SplatCloud& cloud,
                  SplatCloud& gradient) {
  const size_t gaussians = field.layout.gaussians;
  const size_t count = anchors.size();
  const double side = field.root.side;
  const double per_anchor = 1.0 / static_cast<double>(count);
  const double per_splat = per_anchor / static_cast<double>(gaussians);
  std::vector<double> partial(rangeCount(count, kGrain), 0.0);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    double loss = 0;
    std::vector<std::pair<uint32_t, uint32_t>> around;
    for (size_t i = begin; i < end; ++i) {
      const double unit = static_cast<double>(tape.units[i]);
      const double to_unit = 1 / (unit * side);  // of gradients by the world
      const Vec3d anchor = placeOf(anchors, i);
      Vec3d mean = Vec3d::Zero();
      double squares = 0;
      // Of what is far away lengths mean nothing; its gradients by the world are others, too.
      const bool is_far =
          !tape.stretch.empty() &&
          std::any_of(&tape.stretch[i * gaussians], &tape.stretch[i * gaussians] + gaussians,
                      [](float stretch) { return stretch != 1.0f; });
      if (is_far) {
        for (size_t n = i * gaussians; n < (i + 1) * gaussians; ++n) {
          loss += per_splat * weights.opacity * (1 - static_cast<double>(cloud.opacities[n]));
          gradient.opacities[n] -= static_cast<float>(weights.opacity * per_splat);
        }
        continue;
      }
      for (size_t k = 0; k < gaussians; ++k) {
        const size_t n = i * gaussians + k;
        const float* c = &tape.centres[n * 3];
        const Vec3d offset = (Vec3d(c[0], c[1], c[2]) - anchor) / unit;
        mean += offset / static_cast<double>(gaussians);
        squares += offset.squaredNorm() / static_cast<double>(gaussians);
        const Vec3d scale =
            Vec3d(cloud.scales[n * 3], cloud.scales[n * 3 + 1], cloud.scales[n * 3 + 2]) * to_unit;
        loss += per_splat * (weights.volume * scale.prod() +
                             weights.opacity * (1 - static_cast<double>(cloud.opacities[n])));
        for (int axis = 0; axis < 3; ++axis) {
          const double others = scale[(axis + 1) % 3] * scale[(axis + 2) % 3];
          gradient.scales[n * 3 + static_cast<size_t>(axis)] +=
              static_cast<float>(weights.volume * per_splat * others * to_unit);
        }
        gradient.opacities[n] -= static_cast<float>(weights.opacity * per_splat);
      }
      const double deviation = std::sqrt(squares);
      const double length = mean.norm();
      double by_deviation = 0;
      double by_length = 0;
      if (length > kCentred * deviation) {
        const double weight = weights.spread * per_anchor * per_anchor;
        loss += weight * (length - kCentred * deviation);
        by_length += weight;
        by_deviation -= weight * kCentred;
      }
      const auto visit = [&](size_t other) {
        const double distance = (placeOf(anchors, other) - anchor).norm() / unit;
        if (deviation <= distance) return false;
        const double weight = weights.spread * per_anchor * per_anchor;
        loss += weight * (deviation - distance);
        by_deviation += weight;
        return true;
      };
      if (reachesPastNeighbours(anchors, tape, i, deviation * unit)) {
        anchorsAround(anchors, i, deviation * unit, around);
        for (const auto& [first, last] : around) {
          for (size_t other = first; other < last; ++other) {
            if (other != i) visit(other);
          }
        }
      } else {
        for (size_t k = 0; k < kSpacingNeighbours; ++k) {
          const uint32_t other = tape.neighbours[i * kSpacingNeighbours + k];
          if (other == kNoPlace || !visit(other)) break;
        }
      }
      if (by_deviation == 0 && by_length == 0) continue;
      for (size_t k = 0; k < gaussians; ++k) {
        const size_t n = i * gaussians + k;
        const float* c = &tape.centres[n * 3];
        const Vec3d offset = (Vec3d(c[0], c[1], c[2]) - anchor) / unit;
        Vec3d by = Vec3d::Zero();
        if (deviation > 0) by += by_deviation / deviation * offset;
        if (by_length != 0) by += by_length / length * mean;
        by *= to_unit / static_cast<double>(gaussians);
        for (int axis = 0; axis < 3; ++axis) {
          gradient.positions[n * 3 + static_cast<size_t>(axis)] += static_cast<float>(by[axis]);
        }
      }
    }
    partial[begin / kGrain] = loss;
  });
  double loss = 0;
  for (const double part : partial) loss += part;
  return loss;
}

}  // namespace stipple
