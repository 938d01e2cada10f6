#include "splat/edit/stroke_path.h"

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

constexpr size_t kMostCells = 256;  ///< along an axis
/// Cells that all segments may look at together: 10 to 20 ms.
constexpr double kMostVisits = 4e6;
/// Share of the extent that a bound is wider than it is by the formula: rounding must not matter.
constexpr double kSlack = 1e-9;

}  // namespace

StrokePath::StrokePath(std::span<const float> points, double radius) : radius_(radius) {
  const size_t count = points.size() / 2;
  x0_ = x1_ = static_cast<double>(points[0]);
  y0_ = y1_ = static_cast<double>(points[1]);
  for (size_t i = 0; i < count; ++i) {
    const double x = static_cast<double>(points[i * 2]);
    const double y = static_cast<double>(points[i * 2 + 1]);
    x0_ = std::min(x0_, x);
    x1_ = std::max(x1_, x);
    y0_ = std::min(y0_, y);
    y1_ = std::max(y1_, y);
    if (count > 1 && i + 1 == count) break;
    Segment segment{x, y, 0, 0, 0};
    if (count > 1) {
      segment.dx = static_cast<double>(points[i * 2 + 2]) - x;
      segment.dy = static_cast<double>(points[i * 2 + 3]) - y;
    }
    const double squared = segment.dx * segment.dx + segment.dy * segment.dy;
    // A pen that rests: the next segment begins where this one stays.
    if (squared == 0 && i + 2 < count) continue;
    if (squared > 0) segment.inverse = 1 / squared;
    segments_.push_back(segment);
  }
  const double grown = radius * (1 + kSlack);
  x0_ -= grown;
  y0_ -= grown;
  x1_ += grown;
  y1_ += grown;
  layCells();
}

double StrokePath::squaredDistance(const Segment& s, double x, double y) const {
  const double px = x - s.x;
  const double py = y - s.y;
  const double t = std::clamp((px * s.dx + py * s.dy) * s.inverse, 0.0, 1.0);
  const double ex = px - t * s.dx;
  const double ey = py - t * s.dy;
  return ex * ex + ey * ey;
}

/// About how many cells all segments would look at.
double StrokePath::visitsOf(size_t side) const {
  const double width = (x1_ - x0_) / static_cast<double>(side);
  const double height = (y1_ - y0_) / static_cast<double>(side);
  const double reach = radius_ + 0.5 * std::hypot(width, height);
  const double most = static_cast<double>(side);
  double sum = 0;
  for (const Segment& s : segments_) {
    // A slanted segment's cells are those near it, row by row.
    const double rows = std::min(most, (std::abs(s.dy) + 2 * reach) / height + 1);
    const double share = std::min(1.0, 2 * reach / (std::abs(s.dy) + 1e-300));
    sum += rows * std::min(most, (std::abs(s.dx) * share + 2 * reach) / width + 1);
  }
  return sum;
}

/// Every cell whose centre may be within `reach` of the segment.
template <class Visit>
void StrokePath::forCellsNear(const Segment& s, double reach, const Visit& visit) const {
  const auto index = [&](double offset, double size) {
    return static_cast<size_t>(std::clamp(offset / size, 0.0, static_cast<double>(side_ - 1)));
  };
  const size_t first = index(std::min(s.y, s.y + s.dy) - reach - y0_, cell_height_);
  const size_t last = index(std::max(s.y, s.y + s.dy) + reach - y0_, cell_height_);
  for (size_t row = first; row <= last; ++row) {
    // The part of the segment that is within reach of the row's centres, then its span of x.
    const double centre = y0_ + (static_cast<double>(row) + 0.5) * cell_height_;
    double from = 0, to = 1;
    if (s.dy != 0) {
      const double a = (centre - reach - s.y) / s.dy;
      const double b = (centre + reach - s.y) / s.dy;
      from = std::clamp(std::min(a, b), 0.0, 1.0);
      to = std::clamp(std::max(a, b), 0.0, 1.0);
    }
    const double xa = s.x + from * s.dx;
    const double xb = s.x + to * s.dx;
    const size_t left = index(std::min(xa, xb) - reach - x0_, cell_width_);
    const size_t right = index(std::max(xa, xb) + reach - x0_, cell_width_);
    for (size_t column = left; column <= right; ++column) {
      visit(row * side_ + column, x0_ + (static_cast<double>(column) + 0.5) * cell_width_, centre);
    }
  }
}

void StrokePath::layCells() {
  // Too small for cells that can be divided by, or nothing at all.
  constexpr double kSmallest = 1e-280;
  const bool flat = !(x1_ - x0_ > kSmallest && y1_ - y0_ > kSmallest);
  side_ = flat ? 1 : kMostCells;
  while (side_ > 1 && visitsOf(side_) > kMostVisits) side_ /= 2;
  cell_width_ = (x1_ - x0_) / static_cast<double>(side_);
  cell_height_ = (y1_ - y0_) / static_cast<double>(side_);
  if (!flat) {
    columns_per_px_ = 1 / cell_width_;
    rows_per_px_ = 1 / cell_height_;
  }
  states_.assign(side_ * side_, CellState::kOutside);
  begins_.assign(states_.size() + 1, 0);
  if (side_ == 1) {
    states_[0] = CellState::kNear;
    begins_[1] = static_cast<uint32_t>(segments_.size());
    for (uint32_t i = 0; i < segments_.size(); ++i) listed_.push_back(i);
    return;
  }
  const double half =
      0.5 * std::hypot(cell_width_, cell_height_) + kSlack * std::max(x1_ - x0_, y1_ - y0_);
  const double reach = radius_ + half;
  const double sure = radius_ - half;  // below 0: no cell is inside as a whole
  const auto isWithin = [](double squared, double limit) {
    return limit >= 0 && squared <= limit * limit;
  };
  for (const Segment& segment : segments_) {
    forCellsNear(segment, reach, [&](size_t cell, double x, double y) {
      if (states_[cell] == CellState::kInside) return;
      const double squared = squaredDistance(segment, x, y);
      if (isWithin(squared, sure)) {
        states_[cell] = CellState::kInside;
      } else if (isWithin(squared, reach)) {
        states_[cell] = CellState::kNear;
        ++begins_[cell + 1];
      }
    });
  }
  for (size_t cell = 0; cell < states_.size(); ++cell) {
    if (states_[cell] == CellState::kInside) begins_[cell + 1] = 0;
    begins_[cell + 1] += begins_[cell];
  }
  listed_.resize(begins_.back());
  std::vector<uint32_t> ends(begins_.begin(), begins_.end() - 1);
  for (uint32_t i = 0; i < segments_.size(); ++i) {
    forCellsNear(segments_[i], reach, [&](size_t cell, double x, double y) {
      if (states_[cell] != CellState::kNear) return;
      if (isWithin(squaredDistance(segments_[i], x, y), reach)) listed_[ends[cell]++] = i;
    });
  }
}

size_t StrokePath::cellAt(double x, double y) const {
  if (side_ == 1) return 0;
  const auto column = std::min(side_ - 1, static_cast<size_t>((x - x0_) * columns_per_px_));
  const auto row = std::min(side_ - 1, static_cast<size_t>((y - y0_) * rows_per_px_));
  return row * side_ + column;
}

bool StrokePath::covers(double x, double y) const {
  if (x < x0_ || x > x1_ || y < y0_ || y > y1_) return false;
  const size_t cell = cellAt(x, y);
  if (states_[cell] != CellState::kNear) return states_[cell] == CellState::kInside;
  const double squared_radius = radius_ * radius_;
  for (uint32_t i = begins_[cell]; i < begins_[cell + 1]; ++i) {
    if (squaredDistance(segments_[listed_[i]], x, y) <= squared_radius) return true;
  }
  return false;
}

}  // namespace stipple
