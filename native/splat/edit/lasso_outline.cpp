#include "splat/edit/lasso_outline.h"

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

constexpr double kMostRows = 2048;
constexpr double kMostListed = 1 << 22;  ///< edges of all rows together: 128 MiB

}  // namespace

LassoOutline::LassoOutline(std::span<const float> points) {
  const size_t count = points.size() / 2;
  const auto at = [&](size_t i) { return static_cast<double>(points[i]); };
  x0_ = x1_ = at(0);
  y0_ = y1_ = at(1);
  std::vector<Edge> edges;
  double climbed = 0;
  for (size_t i = 0; i < count; ++i) {
    const double x = at(i * 2), y = at(i * 2 + 1);
    x0_ = std::min(x0_, x);
    x1_ = std::max(x1_, x);
    y0_ = std::min(y0_, y);
    y1_ = std::max(y1_, y);
    const size_t next = i + 1 < count ? i + 1 : 0;
    const double end_y = at(next * 2 + 1);
    // A level edge is crossed by no point's row.
    if (end_y == y) continue;
    edges.push_back({x, y, end_y, (at(next * 2) - x) / (end_y - y)});
    climbed += std::abs(end_y - y);
  }
  const double height = y1_ - y0_;
  double rows = std::clamp(static_cast<double>(count), 16.0, kMostRows);
  if (climbed > 0) rows = std::min(rows, std::max(1.0, kMostListed * height / climbed));
  const size_t row_count = height > 0 ? static_cast<size_t>(rows) : 1;
  if (height > 0) rows_per_px_ = static_cast<double>(row_count) / height;
  begins_.assign(row_count + 1, 0);
  for (const Edge& edge : edges) {
    const size_t last = rowAt(std::max(edge.y, edge.end_y));
    for (size_t row = rowAt(std::min(edge.y, edge.end_y)); row <= last; ++row) ++begins_[row + 1];
  }
  for (size_t row = 0; row < row_count; ++row) begins_[row + 1] += begins_[row];
  edges_.resize(begins_.back());
  std::vector<uint32_t> ends(begins_.begin(), begins_.end() - 1);
  for (const Edge& edge : edges) {
    const size_t last = rowAt(std::max(edge.y, edge.end_y));
    for (size_t row = rowAt(std::min(edge.y, edge.end_y)); row <= last; ++row) {
      edges_[ends[row]++] = edge;
    }
  }
}

/// Of y within the outline's; never falls where y rises, so that an edge is in the row of each y
/// between its ends.
size_t LassoOutline::rowAt(double y) const {
  return std::min(begins_.size() - 2, static_cast<size_t>((y - y0_) * rows_per_px_));
}

bool LassoOutline::covers(double x, double y) const {
  if (x < x0_ || x > x1_ || y < y0_ || y > y1_) return false;
  const size_t row = rowAt(y);
  bool inside = false;
  for (uint32_t i = begins_[row]; i < begins_[row + 1]; ++i) {
    const Edge& edge = edges_[i];
    const bool crosses = (edge.y > y) != (edge.end_y > y);
    inside ^= crosses && x < edge.x + (y - edge.y) * edge.slope;
  }
  return inside;
}

}  // namespace stipple
