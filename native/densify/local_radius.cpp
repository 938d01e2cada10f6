// Based on: Zeng, Wang, Ju, Guan, Frequency-Aware Density Control via Reparameterization for
// High-Quality Rendering of 3D Gaussian Splatting, AAAI 2025, and its program.

#include "densify/local_radius.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nanoflann.hpp>

#include "base/parallel.h"

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

/// Calls use(i, distances) with those of the nearest ones to each place, rising, itself left out.
template <typename Use>
void forNeighbours(const Tree& tree, const Places& places, size_t neighbours, const Use& use) {
  parallelFor(places.kdtree_get_point_count(), kGrain, [&](size_t begin, size_t end) {
    std::vector<uint32_t> found(neighbours + 1);
    std::vector<double> distances(neighbours + 1);
    for (size_t i = begin; i < end; ++i) {
      const size_t count =
          tree.knnSearch(&places.values[i * 3], neighbours + 1, found.data(), distances.data());
      for (size_t k = 0; k < count; ++k) distances[k] = std::sqrt(distances[k]);
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
  std::vector<double> nearest(count);
  forNeighbours(tree, places, 1, [&](size_t i, std::span<const double> d) { nearest[i] = d[0]; });
  const auto middle = nearest.begin() + static_cast<ptrdiff_t>(count / 2);
  std::nth_element(nearest.begin(), middle, nearest.end());
  const double width = *middle;
  std::vector<double> radii(count);
  forNeighbours(tree, places, std::min(options.neighbours, count - 1),
                [&](size_t i, std::span<const double> distances) {
                  radii[i] = options.factor * weightedMean(distances, width);
                });
  return radii;
}

}  // namespace stipple
