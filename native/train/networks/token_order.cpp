// Based on: Jonker, Volgenant 1987 (see the header); the order of tokens is VecSeq of DeG,
// density-sampled Gaussians (arXiv 2605.16355).
#include "train/networks/token_order.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "base/error.h"
#include "generate/sobol_points.h"

namespace stipple {

namespace {

constexpr uint32_t kNone = ~uint32_t{0};
/// Of auctions before paths, in squared sides of the unit cube.
constexpr double kFirstStep = 0.01, kStepShare = 0.2;
constexpr int kRounds = 7;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Costs of pairs, by coordinates beside each other, so that compilers make vectors of them.
class Costs {
 public:
  Costs(std::span<const float> points, std::span<const float> places) {
    for (size_t i = 0; i < points.size(); ++i) {
      points_[i % 3].push_back(static_cast<double>(points[i]));
      places_[i % 3].push_back(static_cast<double>(places[i]));
    }
  }
  size_t count() const { return points_[0].size(); }
  double at(size_t point, size_t place) const {
    double sum = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double offset = points_[axis][point] - places_[axis][place];
      sum += offset * offset;
    }
    return sum;
  }
  /// Costs of a point less the prices of places. Out: [n].
  void reduced(size_t point, const std::vector<double>& prices, std::vector<double>& out) const {
    const double x = points_[0][point], y = points_[1][point], z = points_[2][point];
    const double *px = places_[0].data(), *py = places_[1].data(), *pz = places_[2].data();
    for (size_t j = 0; j < out.size(); ++j) {
      const double dx = px[j] - x, dy = py[j] - y, dz = pz[j] - z;
      out[j] = dx * dx + dy * dy + dz * dz - prices[j];
    }
  }

 private:
  std::array<std::vector<double>, 3> points_, places_;
};

class Assigner {
 public:
  Assigner(const Costs& costs, Progress* progress)
      : costs_(costs),
        progress_(progress),
        prices_(costs.count()),
        reduced_(costs.count()),
        place_of_(costs.count(), kNone),
        point_at_(costs.count(), kNone) {}

  Assignment solve() {
    double step = kFirstStep;
    for (int round = 0; round < kRounds; ++round, step *= kStepShare) auction(step);
    std::vector<uint32_t> free = dropUnfounded();
    for (size_t i = 0; i < free.size(); ++i) {
      advance(progress_, static_cast<double>(i) / static_cast<double>(free.size()),
              "Ordering tokens");
      augment(free[i]);
    }
    Assignment made;
    made.column = prices_;
    for (size_t i = 0; i < place_of_.size(); ++i) {
      const double cost = costs_.at(i, place_of_[i]);
      made.cost += cost;
      made.row.push_back(cost - prices_[place_of_[i]]);
    }
    made.place_of = std::move(place_of_);
    return made;
  }

 private:
  void take(uint32_t point, uint32_t place) {
    place_of_[point] = place;
    point_at_[place] = point;
  }

  /// Everybody bids until all have a place: the cheapest to it, which then costs so much more that
  /// the second is cheaper by `step`. Prices that a larger step found make the next auction short.
  void auction(double step) {
    std::vector<uint32_t> free(place_of_.size());
    std::iota(free.begin(), free.end(), 0u);
    std::fill(point_at_.begin(), point_at_.end(), kNone);
    while (!free.empty()) {
      if (progress_ != nullptr) progress_->throwIfCancelled();
      const uint32_t point = free.back();
      free.pop_back();
      costs_.reduced(point, prices_, reduced_);
      double least = kInfinity, next = kInfinity;
      uint32_t first = 0;
      for (uint32_t j = 0; j < reduced_.size(); ++j) {
        if (reduced_[j] >= next) continue;
        if (reduced_[j] < least) {
          next = least;
          least = reduced_[j];
          first = j;
        } else {
          next = reduced_[j];
        }
      }
      if (next < kInfinity) prices_[first] -= next - least + step;
      if (point_at_[first] != kNone) free.push_back(point_at_[first]);
      take(point, first);
    }
  }

  /// Points whose place is not their cheapest lose it. Returns them.
  std::vector<uint32_t> dropUnfounded() {
    std::vector<uint32_t> free;
    for (uint32_t i = 0; i < place_of_.size(); ++i) {
      costs_.reduced(i, prices_, reduced_);
      if (reduced_[place_of_[i]] <= *std::min_element(reduced_.begin(), reduced_.end())) continue;
      point_at_[place_of_[i]] = kNone;
      place_of_[i] = kNone;
      free.push_back(i);
    }
    return free;
  }

  /// The cheapest path from a free point to a free place, along which all move on.
  void augment(uint32_t start) {
    const size_t count = place_of_.size();
    std::vector<double> distance(count);
    std::vector<uint32_t> from(count, start), reached;
    std::vector<uint8_t> is_reached(count, 0);
    costs_.reduced(start, prices_, distance);
    uint32_t end = kNone;
    double length = 0;
    while (end == kNone) {
      if (progress_ != nullptr) progress_->throwIfCancelled();
      uint32_t next = kNone;
      length = kInfinity;
      for (uint32_t j = 0; j < count; ++j) {
        if (is_reached[j] || distance[j] >= length) continue;
        length = distance[j];
        next = j;
      }
      is_reached[next] = 1;
      reached.push_back(next);
      if (point_at_[next] == kNone) {
        end = next;
        break;
      }
      const uint32_t point = point_at_[next];
      costs_.reduced(point, prices_, reduced_);
      const double offset = length - reduced_[next];
      for (uint32_t j = 0; j < count; ++j) {
        const double through = reduced_[j] + offset;
        if (is_reached[j] || through >= distance[j]) continue;
        distance[j] = through;
        from[j] = point;
      }
    }
    for (const uint32_t j : reached) prices_[j] += distance[j] - length;
    for (uint32_t place = end;;) {
      const uint32_t point = from[place], before = place_of_[point];
      take(point, place);
      if (point == start) break;
      place = before;
    }
  }

  const Costs& costs_;
  Progress* progress_;
  std::vector<double> prices_, reduced_;
  std::vector<uint32_t> place_of_, point_at_;
};

void requirePoints(std::span<const float> values, const char* name) {
  for (const float value : values) {
    if (std::isfinite(value)) continue;
    fail(ErrorCode::kInvalidArgument, std::string("a number of the ") + name + " is " +
                                          std::to_string(value) + "; finite ones are needed");
  }
}

}  // namespace

Assignment leastSquaresAssignment(std::span<const float> points, std::span<const float> places,
                                  Progress* progress) {
  if (points.size() != places.size()) {
    fail(ErrorCode::kInvalidArgument, "there are " + std::to_string(points.size() / 3) +
                                          " points and " + std::to_string(places.size() / 3) +
                                          " places; as many are needed");
  }
  requirePoints(points, "points");
  requirePoints(places, "places");
  if (points.empty()) return {};
  const Costs costs(points, places);
  return Assigner(costs, progress).solve();
}

std::vector<uint32_t> tokenOrder(std::span<const float> points, Progress* progress) {
  const Assignment found = leastSquaresAssignment(points, sobolPoints(points.size() / 3), progress);
  std::vector<uint32_t> order(found.place_of.size());
  for (uint32_t i = 0; i < order.size(); ++i) order[found.place_of[i]] = i;
  return order;
}

}  // namespace stipple
