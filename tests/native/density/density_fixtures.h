#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "density/octree_density.h"

namespace stipple {

constexpr float kNoMass = -std::numeric_limits<float>::infinity();

/// Hides what an octree is, so that it is sampled level by level as any model is.
class AnyModel final : public DensityModel {
 public:
  explicit AnyModel(const OctreeDensity& octree) : octree_(octree) {}
  int leafLevel() const override { return octree_.leafLevel(); }
  const RootCube& root() const override { return octree_.root(); }
  void childLogProbabilities(int level, std::span<const uint64_t> cells, std::span<float> out,
                             Progress* = nullptr) const override {
    octree_.childLogProbabilities(level, cells, out);
  }

 private:
  const OctreeDensity& octree_;
};

/// Weighted points on a wavy sheet and in a ball: cells with one to eight children, uneven masses.
struct TestPoints {
  std::vector<float> positions;
  std::vector<float> weights;
};

inline TestPoints wavyPoints(size_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0.0f, 1.0f);
  TestPoints points;
  for (size_t i = 0; i < count; ++i) {
    float x = uniform(random);
    float y = uniform(random);
    float z = 0.5f + 0.2f * std::sin(7.0f * x) * std::cos(5.0f * y);
    if (i % 4 == 0) {
      z = 0.1f * uniform(random);
      y *= 0.1f;
      x *= 0.1f;
    }
    points.positions.insert(points.positions.end(), {x, y, z});
    points.weights.push_back(uniform(random) * uniform(random) + 1e-4f);
  }
  return points;
}

inline OctreeDensity wavyOctree(size_t count, int leaf_level, uint32_t seed = 1) {
  const TestPoints points = wavyPoints(count, seed);
  return OctreeDensity::fromPoints(points.positions, points.weights, {leaf_level});
}

/// An octree of one level with the given masses of the eight children.
inline OctreeDensity oneLevel(const std::vector<double>& masses) {
  double total = 0.0;
  for (const double mass : masses) total += mass;
  std::vector<float> logs;
  for (const double mass : masses) {
    logs.push_back(mass > 0.0 ? static_cast<float>(std::log(mass / total)) : kNoMass);
  }
  return OctreeDensity::fromLevels({}, {{0}}, {logs});
}

}  // namespace stipple
