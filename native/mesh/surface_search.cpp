#include "mesh/surface_search.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace stipple {

namespace {

constexpr uint32_t kLeafTriangles = 4;

/// The share of the way from a to b that is nearest to the point, 0..1.
double nearestOnEdge(const Vec3d& point, const Vec3d& a, const Vec3d& b) {
  const Vec3d edge = b - a;
  const double length = edge.squaredNorm();
  return length > 0 ? std::clamp((point - a).dot(edge) / length, 0.0, 1.0) : 0.0;
}

double squaredDistance(const Vec3d& point, const std::array<float, 3>& low,
                       const std::array<float, 3>& high) {
  double sum = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<size_t>(axis);
    const double below = static_cast<double>(low[a]) - point[axis];
    const double above = point[axis] - static_cast<double>(high[a]);
    const double outside = std::max({below, above, 0.0});
    sum += outside * outside;
  }
  return sum;
}

bool before(const SurfacePlace& a, const SurfacePlace& b) {
  return a.squared != b.squared ? a.squared < b.squared : a.triangle < b.triangle;
}

}  // namespace

SurfacePlace nearestOnTriangle(const Vec3d& point, const std::array<Vec3d, 3>& corners) {
  const Vec3d u = corners[1] - corners[0], v = corners[2] - corners[0], p = point - corners[0];
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), pu = p.dot(u), pv = p.dot(v);
  const double determinant = uu * vv - uv * uv;
  SurfacePlace place;
  // A sliver, thinner than 1e-5 of its length, is as good as its edges; rounding leaves no plane of
  // it.
  if (determinant > 1e-10 * uu * vv) {
    const double second = (vv * pu - uv * pv) / determinant;
    const double third = (uu * pv - uv * pu) / determinant;
    if (second >= 0 && third >= 0 && second + third <= 1) {
      place.weights = {1 - second - third, second, third};
      place.squared = (p - second * u - third * v).squaredNorm();
      return place;
    }
  }
  place.squared = std::numeric_limits<double>::infinity();
  for (size_t from = 0; from < 3; ++from) {
    const size_t to = (from + 1) % 3;
    const double share = nearestOnEdge(point, corners[from], corners[to]);
    const double squared =
        (point - corners[from] - share * (corners[to] - corners[from])).squaredNorm();
    if (squared >= place.squared) continue;
    place.squared = squared;
    place.weights = {0, 0, 0};
    place.weights[from] = 1 - share;
    place.weights[to] = share;
  }
  return place;
}

SurfaceSearch::SurfaceSearch(std::span<const float> positions, std::span<const uint32_t> triangles)
    : positions_(positions), triangles_(triangles), order_(triangles.size() / 3) {
  std::iota(order_.begin(), order_.end(), 0u);
  std::vector<std::array<float, 3>> centroids(order_.size());
  for (uint32_t t = 0; t < order_.size(); ++t) {
    const std::array<Vec3d, 3> corners = cornersOf(t);
    const Vec3d centroid = (corners[0] + corners[1] + corners[2]) / 3;
    for (int axis = 0; axis < 3; ++axis) {
      centroids[t][static_cast<size_t>(axis)] = static_cast<float>(centroid[axis]);
    }
  }
  nodes_.reserve(order_.size());
  build(0, static_cast<uint32_t>(order_.size()), centroids);
}

std::array<Vec3d, 3> SurfaceSearch::cornersOf(uint32_t triangle) const {
  std::array<Vec3d, 3> corners;
  for (size_t corner = 0; corner < 3; ++corner) {
    const float* at = positions_.data() + size_t{3} * triangles_[size_t{3} * triangle + corner];
    corners[corner] = Vec3d(at[0], at[1], at[2]);
  }
  return corners;
}

uint32_t SurfaceSearch::build(uint32_t begin, uint32_t end,
                              const std::vector<std::array<float, 3>>& centroids) {
  constexpr float kLargest = std::numeric_limits<float>::max();
  Node node = {{kLargest, kLargest, kLargest}, {-kLargest, -kLargest, -kLargest}, begin, end, 0};
  std::array<float, 3> low = node.low, high = node.high;  // of the centroids
  for (uint32_t i = begin; i < end; ++i) {
    const size_t triangle = order_[i];
    for (size_t axis = 0; axis < 3; ++axis) {
      for (size_t corner = 0; corner < 3; ++corner) {
        const float value = positions_[size_t{3} * triangles_[3 * triangle + corner] + axis];
        node.low[axis] = std::min(node.low[axis], value);
        node.high[axis] = std::max(node.high[axis], value);
      }
      low[axis] = std::min(low[axis], centroids[triangle][axis]);
      high[axis] = std::max(high[axis], centroids[triangle][axis]);
    }
  }
  const auto index = static_cast<uint32_t>(nodes_.size());
  nodes_.push_back(node);
  if (end - begin <= kLeafTriangles) return index;
  size_t axis = 0;
  for (size_t other = 1; other < 3; ++other) {
    if (high[other] - low[other] > high[axis] - low[axis]) axis = other;
  }
  const uint32_t middle = begin + (end - begin) / 2;
  const auto at = [&](uint32_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end), [&](uint32_t a, uint32_t b) {
    const float x = centroids[a][axis], y = centroids[b][axis];
    return x != y ? x < y : a < b;
  });
  build(begin, middle, centroids);
  const uint32_t second = build(middle, end, centroids);
  nodes_[index].second = second;
  return index;
}

void SurfaceSearch::nearest(const Vec3d& point, size_t count,
                            std::vector<SurfacePlace>& places) const {
  places.clear();
  // The tree halves its triangles: 2^32 of them are 33 levels, with one waiting child at each.
  std::array<std::pair<double, uint32_t>, 40> waiting;
  size_t depth = 0;
  waiting[depth++] = {0.0, 0u};
  while (depth > 0) {
    const auto [distance, index] = waiting[--depth];
    if (places.size() == count && distance > places.front().squared) continue;
    const Node& node = nodes_[index];
    if (node.second != 0) {
      const uint32_t first = index + 1;
      const double a = squaredDistance(point, nodes_[first].low, nodes_[first].high);
      const double b = squaredDistance(point, nodes_[node.second].low, nodes_[node.second].high);
      waiting[depth++] = a < b ? std::pair(b, node.second) : std::pair(a, first);
      waiting[depth++] = a < b ? std::pair(a, first) : std::pair(b, node.second);
      continue;
    }
    for (uint32_t i = node.begin; i < node.end; ++i) {
      SurfacePlace place = nearestOnTriangle(point, cornersOf(order_[i]));
      place.triangle = order_[i];
      if (places.size() == count) {
        if (!before(place, places.front())) continue;
        std::pop_heap(places.begin(), places.end(), before);
        places.pop_back();
      }
      places.push_back(place);
      std::push_heap(places.begin(), places.end(), before);
    }
  }
  std::sort_heap(places.begin(), places.end(), before);
}

}  // namespace stipple
