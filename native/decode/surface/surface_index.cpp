#include "decode/surface/surface_index.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "math/morton.h"
#include "mesh/cell_table.h"

namespace stipple {

uint64_t unitCubeCode(const float* position, int level) {
  const float side = static_cast<float>(uint32_t{1} << level);
  uint32_t cell[3];
  for (size_t axis = 0; axis < 3; ++axis) {
    cell[axis] = static_cast<uint32_t>(std::clamp(position[axis] * side, 0.0f, side - 1.0f));
  }
  return mortonEncode(cell[0], cell[1], cell[2]);
}

namespace {

/// By the flux of places through the surface, three times the volume that it encloses (the
/// divergence theorem), from its middle: a sheet has none of it, however it faces.
float outwardOf(const SurfaceIndex& index) {
  constexpr double kFlat = 0.02;  ///< of the flux if all normals pointed away from the middle
  double middle[3] = {0, 0, 0};
  for (size_t i = 0; i < index.size(); ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      middle[axis] += static_cast<double>(index.areas[i]) *
                      static_cast<double>(index.positions[i * 3 + axis]) / index.area;
    }
  }
  double flux = 0, most = 0;
  for (size_t i = 0; i < index.size(); ++i) {
    double along = 0, squared = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double d = static_cast<double>(index.positions[i * 3 + axis]) - middle[axis];
      along += d * static_cast<double>(index.normals[i * 3 + axis]);
      squared += d * d;
    }
    flux += static_cast<double>(index.areas[i]) * along;
    most += static_cast<double>(index.areas[i]) * std::sqrt(squared);
  }
  return most > 0 ? static_cast<float>(std::clamp(flux / (kFlat * most), -1.0, 1.0)) : 0.0f;
}

}  // namespace

SurfaceIndex makeSurfaceIndex(const PointSet& surface, const RootCube& root, int leaf_level) {
  constexpr size_t kGrain = 8192;
  constexpr double kSideCells = double{uint32_t{1} << SurfaceIndex::kCodeLevel};
  const size_t count = surface.size();
  SurfaceIndex index;
  index.root = root;
  index.leaf_level = leaf_level;
  const auto unitPosition = [&](size_t i) {
    std::array<float, 3> u;
    for (size_t axis = 0; axis < 3; ++axis) {
      u[axis] = static_cast<float>(
          (static_cast<double>(surface.positions[i * 3 + axis]) - root.origin[axis]) / root.side);
    }
    return u;
  };
  std::vector<uint64_t> codes(count);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      // The same arithmetic as the density's, so that a leaf with mass holds its samples here too.
      uint32_t cell[3];
      for (size_t axis = 0; axis < 3; ++axis) {
        const double x =
            (static_cast<double>(surface.positions[i * 3 + axis]) - root.origin[axis]) *
            (kSideCells / root.side);
        cell[axis] = static_cast<uint32_t>(std::clamp(std::floor(x), 0.0, kSideCells - 1.0));
      }
      codes[i] = mortonEncode(cell[0], cell[1], cell[2]);
    }
  });
  const std::vector<uint32_t> order = sortedOrder(codes, SurfaceIndex::kCodeLevel * 3);

  const double area_scale = 1.0 / (root.side * root.side);
  double weight_sum = 0;
  for (size_t i = 0; i < count; ++i) {
    weight_sum += static_cast<double>(surface.weights[i]);
    index.area += static_cast<double>(surface.areas[i]) * area_scale;
  }
  index.codes.resize(count);
  index.positions.resize(count * 3);
  index.normals.resize(count * 3);
  index.colours.resize(count * 3);
  index.opacities.resize(count);
  index.areas.resize(count);
  index.spreads.resize(count);
  index.harmonic_degree = surface.harmonic_degree;
  index.harmonic_stride = surface.harmonicStride();
  index.harmonics.resize(count * index.harmonic_stride);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const size_t from = order[i];
      const std::array<float, 3> u = unitPosition(from);
      index.codes[i] = codes[from];
      for (size_t axis = 0; axis < 3; ++axis) {
        index.positions[i * 3 + axis] = u[axis];
        index.normals[i * 3 + axis] = surface.normals[from * 3 + axis];
        index.colours[i * 3 + axis] = surface.colours[from * 3 + axis];
      }
      index.opacities[i] = surface.opacities[from];
      std::copy_n(
          surface.harmonics.begin() + static_cast<std::ptrdiff_t>(from * index.harmonic_stride),
          index.harmonic_stride,
          index.harmonics.begin() + static_cast<std::ptrdiff_t>(i * index.harmonic_stride));
      const double area = static_cast<double>(surface.areas[from]) * area_scale;
      const double weight = static_cast<double>(surface.weights[from]);
      index.areas[i] = static_cast<float>(area);
      // A place without weight gets no anchors of its own; its neighbours' splats stretch to it at
      // most over the average spacing.
      index.spreads[i] = static_cast<float>(weight > 0 ? area * weight_sum / weight : index.area);
    }
  });
  index.outward = outwardOf(index);
  return index;
}

}  // namespace stipple
