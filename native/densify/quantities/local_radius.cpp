// Based on: Zeng, Wang, Ju, Guan, Frequency-Aware Density Control via Reparameterization for
// High-Quality Rendering of 3D Gaussian Splatting, AAAI 2025, and its program.

#include "densify/quantities/local_radius.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nanoflann.hpp>
#include <utility>

#include "base/parallel.h"
#include "math/morton.h"

namespace stipple {

namespace {

constexpr double kFarthest = 1e15;  ///< metres; squares of distances stay in range
constexpr size_t kPlacesPerLeaf = 16;
constexpr size_t kGrain = 1024;

/// The view of the places that nanoflann wants.
struct Places {
  std::vector<double> values;  ///< [N,3]

  size_t kdtree_get_point_count() const { return values.size() / 3; }
  double kdtree_get_pt(size_t index, size_t axis) const { return values[index * 3 + axis]; }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Places>,
                                                 Places, 3, uint32_t>;

/// Rows along a curve that stays close to itself: one search finds in the caches what the one
/// before it has read.
std::vector<uint32_t> mortonOrder(const Places& places) {
  const size_t count = places.kdtree_get_point_count();
  double low[3], scale[3];
  for (size_t axis = 0; axis < 3; ++axis) {
    double high = low[axis] = places.values[axis];
    for (size_t i = 0; i < count; ++i) {
      low[axis] = std::min(low[axis], places.values[i * 3 + axis]);
      high = std::max(high, places.values[i * 3 + axis]);
    }
    constexpr double kCells = 2097151;  // 21 bits
    scale[axis] = high > low[axis] ? kCells / (high - low[axis]) : 0;
  }
  std::vector<std::pair<uint64_t, uint32_t>> codes(count);
  for (uint32_t i = 0; i < count; ++i) {
    uint32_t cell[3];
    for (size_t axis = 0; axis < 3; ++axis) {
      cell[axis] = static_cast<uint32_t>((places.values[i * 3 + axis] - low[axis]) * scale[axis]);
    }
    codes[i] = {mortonEncode(cell[0], cell[1], cell[2]), i};
  }
  std::sort(codes.begin(), codes.end());
  std::vector<uint32_t> order(count);
  for (size_t k = 0; k < count; ++k) order[k] = codes[k].second;
  return order;
}

/// Calls use(i, distances) with those of the nearest ones to each place, rising, itself left out.
template <typename Use>
void forNeighbours(const Tree& tree, const Places& places, const std::vector<uint32_t>& order,
                   size_t neighbours, const Use& use) {
  parallelFor(order.size(), kGrain, [&](size_t begin, size_t end) {
    std::vector<uint32_t> found(neighbours + 1);
    std::vector<double> distances(neighbours + 1);
    for (size_t k = begin; k < end; ++k) {
      const size_t i = order[k];
      const size_t count =
          tree.knnSearch(&places.values[i * 3], neighbours + 1, found.data(), distances.data());
      for (size_t n = 0; n < count; ++n) distances[n] = std::sqrt(distances[n]);
      // The first is the place itself or a twin, at the same distance of 0.
      use(i, std::span<const double>(distances).subspan(1, count - 1));
    }
  });
}

double weightedMean(std::span<const double> distances, double width) {
  double sum = 0, weights = 0;
  for (const double distance : distances) {
    const double x = width > 0 ? (distance - distances[0]) / width : 0;
    const double weight = std::exp(-std::min(x * x, 700.0));
    sum += weight * distance;
    weights += weight;
  }
  return sum / weights;
}

}  // namespace

std::vector<double> localRadii(std::span<const float> positions,
                               const LocalRadiusOptions& options) {
  const size_t count = positions.size() / 3;
  if (count < 2) return {};
  Places places;
  for (const float value : positions) {
    places.values.push_back(std::clamp(static_cast<double>(value), -kFarthest, kFarthest));
  }
  Tree tree(3, places, nanoflann::KDTreeSingleIndexAdaptorParams(kPlacesPerLeaf));
  tree.buildIndex();
  const std::vector<uint32_t> order = mortonOrder(places);
  std::vector<double> nearest(count);
  forNeighbours(tree, places, order, 1,
                [&](size_t i, std::span<const double> d) { nearest[i] = d[0]; });
  const auto middle = nearest.begin() + static_cast<ptrdiff_t>(count / 2);
  std::nth_element(nearest.begin(), middle, nearest.end());
  const double width = *middle;
  std::vector<double> radii(count);
  forNeighbours(tree, places, order, std::min(options.neighbours, count - 1),
                [&](size_t i, std::span<const double> distances) {
                  radii[i] = options.factor * weightedMean(distances, width);
                });
  return radii;
}

}  // namespace stipple
