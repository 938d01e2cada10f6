// Based on: Cook, Stochastic Sampling in Computer Graphics, TOG 1986 (one jittered sample for each
// equal share of the running area); Osada et al., Shape Distributions, TOG 2002, section 4.2 (an
// even point of a triangle).
#include "mesh/adapt/moving_samples.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "base/random.h"
#include "math/cross_product.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;

}  // namespace

Vec3d areaVector(std::span<const uint32_t> triangles, std::span<const Vec3d> positions,
                 uint32_t triangle) {
  const uint32_t* corner = &triangles[size_t{triangle} * 3];
  return crossProduct(positions[corner[1]] - positions[corner[0]],
                      positions[corner[2]] - positions[corner[0]]);
}

std::vector<SurfaceSample> spreadSamples(std::span<const uint32_t> triangles,
                                         std::span<const Vec3d> positions, size_t count,
                                         uint64_t seed) {
  std::vector<double> running(triangles.size() / 3);
  parallelFor(running.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      running[t] = areaVector(triangles, positions, static_cast<uint32_t>(t)).norm();
    }
  });
  double sum = 0;
  for (double& area : running) {
    sum += area;
    area = sum;
  }
  if (!(sum > 0) || !std::isfinite(sum)) return {};
  std::vector<SurfaceSample> samples(count);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const uint64_t bits = keyedBits(seed, RandomUse::kMovingSample, i);
      const double height =
          (static_cast<double>(i) + unitDouble(bits)) * sum / static_cast<double>(count);
      auto found = std::upper_bound(running.begin(), running.end(), height);
      // Rounding can leave the last height on the total.
      if (found == running.end()) found = std::lower_bound(running.begin(), running.end(), sum);
      const double root = std::sqrt(unitDouble(mixBits(bits)));
      const double part = unitDouble(mixBits(bits + 1));
      samples[i] = {static_cast<uint32_t>(found - running.begin()),
                    {1 - root, root * (1 - part), root * part}};
    }
  });
  return samples;
}

std::array<Vec3d, 3> normalGradient(std::span<const uint32_t> triangles,
                                    std::span<const Vec3d> positions, uint32_t triangle,
                                    const Vec3d& by_normal, double floor) {
  const uint32_t* corner = &triangles[size_t{triangle} * 3];
  const Vec3d first = positions[corner[1]] - positions[corner[0]];
  const Vec3d second = positions[corner[2]] - positions[corner[0]];
  const Vec3d across = crossProduct(first, second);
  const double length = across.norm();
  if (!(length > 0)) return {Vec3d::Zero(), Vec3d::Zero(), Vec3d::Zero()};
  const Vec3d normal = across / length;
  const Vec3d by_across = (by_normal - normal * normal.dot(by_normal)) / std::max(length, floor);
  const Vec3d by_second_corner = crossProduct(second, by_across);
  const Vec3d by_third_corner = crossProduct(by_across, first);
  return {-by_second_corner - by_third_corner, by_second_corner, by_third_corner};
}

}  // namespace stipple
