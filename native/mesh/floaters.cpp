#include "mesh/floaters.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "mesh/point_components.h"

namespace stipple {

namespace {

/// Median absolute deviation to standard deviation, for a normal distribution.
constexpr double kMadToSigma = 1.4826;
/// Sizes beyond this many deviations (of logarithms), and at least this factor, are no surface's.
constexpr double kSizeSigmas = 4.0;
constexpr double kSizeFactor = 10.0;
/// The same for distances to neighbours: generous, since a gap in a surface must not cut it.
constexpr double kRadiusSigmas = 3.0;
constexpr double kRadiusFactor = 3.0;
constexpr size_t kNeighbour = 8;
constexpr size_t kQueries = 20000;

void requireRange(double value, double low, double high, const char* what) {
  if (!(value >= low && value <= high)) {
    fail(ErrorCode::kInvalidArgument, std::string(what) + " is " + std::to_string(value) + "; " +
                                          std::to_string(low) + " to " + std::to_string(high) +
                                          " is allowed");
  }
}

double medianOf(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// median * max(factor, exp(sigmas * deviation of logarithms)), of the positive values. 0: none.
double robustLimit(const std::vector<double>& values, double sigmas, double factor) {
  std::vector<double> logs;
  logs.reserve(values.size());
  for (const double value : values) {
    if (value > 0) logs.push_back(std::log(value));
  }
  if (logs.empty()) return 0;
  const double median = medianOf(logs);
  for (double& value : logs) value = std::abs(value - median);
  const double sigma = kMadToSigma * medianOf(logs);
  return std::exp(median + std::max(std::log(factor), sigmas * sigma));
}

double sizeOf(const SplatCloud& cloud, size_t i) {
  const float* s = &cloud.scales[i * 3];
  return static_cast<double>(std::max(s[0], std::max(s[1], s[2])));
}

double automaticMaxSize(const SplatCloud& cloud, const std::vector<uint32_t>& rest) {
  std::vector<double> sizes(rest.size());
  for (size_t i = 0; i < rest.size(); ++i) sizes[i] = sizeOf(cloud, rest[i]);
  return robustLimit(sizes, kSizeSigmas, kSizeFactor);
}

/// Takes the splats that fail a test out of `rest` and of the mask; returns how many.
template <typename Fails>
uint64_t drop(std::vector<uint32_t>& rest, std::vector<uint8_t>& mask, Fails&& fails) {
  const size_t before = rest.size();
  std::erase_if(rest, [&](uint32_t i) {
    if (!fails(i)) return false;
    mask[i] = 0;
    return true;
  });
  return before - rest.size();
}

void dropIsolated(const SplatCloud& cloud, const FloaterOptions& options,
                  std::vector<uint32_t>& rest, std::vector<uint8_t>& mask, FloaterReport& report,
                  Progress* progress) {
  std::vector<float> points(rest.size() * 3);
  for (size_t i = 0; i < rest.size(); ++i) {
    std::copy_n(&cloud.positions[size_t{rest[i]} * 3], 3, &points[i * 3]);
  }
  advance(progress, 0.1, "Measuring distances");
  report.radius = options.radius ? *options.radius : connectingRadius(points);
  report.min_group_count =
      options.min_group_count.value_or(std::clamp<uint64_t>(rest.size() / 1000, 10, 1000));
  // All at one place: there is nothing that could be isolated.
  if (!(report.radius > 0)) {
    report.group_count = 1;
    return;
  }
  const std::vector<uint32_t> groups = pointComponents(points, report.radius, progress);
  std::vector<uint32_t> sizes(rest.size(), 0);
  for (const uint32_t group : groups) ++sizes[group];
  const uint32_t largest = *std::max_element(sizes.begin(), sizes.end());
  report.group_count = static_cast<uint64_t>(
      std::count_if(sizes.begin(), sizes.end(), [](uint32_t n) { return n > 0; }));
  size_t row = 0;
  report.isolated = drop(rest, mask, [&](uint32_t) {
    const uint32_t size = sizes[groups[row++]];
    return size < report.min_group_count && size < largest;
  });
}

}  // namespace

std::vector<uint8_t> withoutFloaters(const SplatCloud& cloud, const FloaterOptions& options,
                                     FloaterReport& report, Progress* progress) {
  validate(cloud, "cloud");
  requireRange(options.min_opacity, 0, 1, "min_opacity");
  if (options.max_size) requireRange(*options.max_size, 0, 1e30, "max_size");
  if (options.radius) requireRange(*options.radius, 1e-30, 1e30, "radius");
  if (cloud.size() > UINT32_MAX) {
    fail(ErrorCode::kUnsupported, "cloud has " + std::to_string(cloud.size()) +
                                      " splats; at most 4294967295 can be searched for floaters");
  }
  report = {};
  std::vector<uint8_t> mask(cloud.size(), 1);
  std::vector<uint32_t> rest(cloud.size());
  for (uint32_t i = 0; i < rest.size(); ++i) rest[i] = i;
  advance(progress, 0.0, "Looking for faint and large splats");
  if (options.by_opacity) {
    report.faint = drop(rest, mask, [&](uint32_t i) {
      return static_cast<double>(cloud.opacities[i]) < options.min_opacity;
    });
  }
  if (options.by_size && !rest.empty()) {
    report.max_size = options.max_size ? *options.max_size : automaticMaxSize(cloud, rest);
    report.large = drop(rest, mask, [&](uint32_t i) { return sizeOf(cloud, i) > report.max_size; });
  }
  if (options.by_connectivity && !rest.empty()) {
    dropIsolated(cloud, options, rest, mask, report, progress);
  }
  report.kept = rest.size();
  return mask;
}

double connectingRadius(const std::vector<float>& points) {
  const size_t count = points.size() / 3;
  const size_t query_count = std::min(count, kQueries);
  std::vector<uint32_t> queries(query_count);
  for (size_t i = 0; i < query_count; ++i) {
    queries[i] = static_cast<uint32_t>(i * count / query_count);
  }
  return robustLimit(neighbourDistances(points, queries, kNeighbour), kRadiusSigmas, kRadiusFactor);
}

}  // namespace stipple
