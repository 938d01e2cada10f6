#include "mesh/adapt/nearest_points.h"

#include <numeric>
#include <vector>

#include "mesh/point_tree.h"

namespace stipple {

namespace {

constexpr size_t kLeafSize = 16;

std::vector<uint32_t> allOf(size_t count) {
  std::vector<uint32_t> rows(count);
  std::iota(rows.begin(), rows.end(), 0u);
  return rows;
}

}  // namespace

struct NearestPoints::Tree {
  explicit Tree(std::span<const float> points)
      : chosen(allOf(points.size() / 3)),
        rows{points, chosen},
        tree(3, rows, nanoflann::KDTreeSingleIndexAdaptorParams(kLeafSize)) {}

  std::vector<uint32_t> chosen;
  PointRows rows;
  PointTree tree;
};

NearestPoints::NearestPoints(std::span<const float> points)
    : tree_(std::make_unique<const Tree>(points)) {}

NearestPoints::~NearestPoints() = default;

uint32_t NearestPoints::nearest(const Vec3d& to) const {
  const float query[3] = {static_cast<float>(to[0]), static_cast<float>(to[1]),
                          static_cast<float>(to[2])};
  uint32_t index = 0;
  double squared = 0;
  return tree_->tree.knnSearch(query, 1, &index, &squared) == 1 ? index : 0;
}

}  // namespace stipple
