#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "splat/volume_probe.h"
#include "splat/voxels/voxelize.h"

namespace stipple {

constexpr double kPi = std::numbers::pi;

struct OneSplat {
  Vec3d position = Vec3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Vec3d scales = Vec3d::Ones();
  double opacity = 0.5;
  Vec3d dc = Vec3d::Zero();
};

inline SplatCloud makeCloud(const std::vector<OneSplat>& splats,
                            ColourSpace colour_space = ColourSpace::kLinear) {
  SplatCloud cloud;
  cloud.colour_space = colour_space;
  cloud.resize(splats.size());
  for (size_t i = 0; i < splats.size(); ++i) {
    const OneSplat& s = splats[i];
    const double q[4] = {s.rotation.w(), s.rotation.x(), s.rotation.y(), s.rotation.z()};
    for (size_t k = 0; k < 4; ++k) cloud.rotations[i * 4 + k] = static_cast<float>(q[k]);
    for (size_t k = 0; k < 3; ++k) {
      cloud.positions[i * 3 + k] = static_cast<float>(s.position[static_cast<Eigen::Index>(k)]);
      cloud.scales[i * 3 + k] = static_cast<float>(s.scales[static_cast<Eigen::Index>(k)]);
      cloud.sh[i * 3 + k] = static_cast<float>(s.dc[static_cast<Eigen::Index>(k)]);
    }
    cloud.opacities[i] = static_cast<float>(s.opacity);
  }
  return cloud;
}

inline SplatCloud randomCloud(size_t count, uint64_t seed) {
  std::vector<OneSplat> splats(count);
  uint64_t index = 0;
  const auto next = [&] { return unitDouble(keyedBits(seed, RandomUse::kDecoder, index++)); };
  for (OneSplat& s : splats) {
    s.position = Vec3d(next(), next(), next());
    s.rotation = Eigen::Quaterniond(next() - 0.5, next() - 0.5, next() - 0.5, next() - 0.5);
    s.rotation.normalize();
    s.scales = Vec3d(0.002 + 0.05 * next(), 0.002 + 0.05 * next(), 0.002 + 0.01 * next());
    s.opacity = next();
    s.dc = Vec3d(next() * 3 - 1, next() * 3 - 1, next() * 3 - 1);
  }
  return makeCloud(splats);
}

// The formula alone: no low-pass, no cut-off, nothing thrown away.
inline VoxelizeOptions exactOptions(double voxel_size) {
  VoxelizeOptions options;
  options.voxel_size = voxel_size;
  options.low_pass = 0.0;
  options.cut_off_sigma = 0.0;
  options.min_density = 0.0;
  return options;
}

inline SparseVolume voxelizeOne(const OneSplat& splat, const VoxelizeOptions& options) {
  const SplatCloud cloud = makeCloud({splat});
  const SplatInstance instance{&cloud, Mat4d::Identity()};
  return voxelize({&instance, 1}, options);
}

// float opacities: 0.99f is a little below 0.99.
inline double usedOpacity(double opacity) {
  return std::min(0.99, static_cast<double>(static_cast<float>(opacity)));
}

inline double closedForm(double opacity, double distance) {
  return -std::log1p(-usedOpacity(opacity) * std::exp(-0.5 * distance * distance));
}

inline std::vector<Vec3d> fibonacciSphere(int count) {
  std::vector<Vec3d> directions;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count;
    const double phi = i * kPi * (3.0 - std::sqrt(5.0));
    const double r = std::sqrt(1.0 - z * z);
    directions.emplace_back(r * std::cos(phi), r * std::sin(phi), z);
  }
  return directions;
}

inline ErrorCode codeOf(const SplatCloud& cloud, const VoxelizeOptions& options,
                        std::string& message, uint64_t limit = UINT64_MAX,
                        const Mat4d& matrix = Mat4d::Identity()) {
  const SplatInstance instance{&cloud, matrix};
  try {
    voxelize({&instance, 1}, options, limit);
  } catch (const Error& error) {
    message = error.what();
    return error.code();
  }
  message = "no error";
  return ErrorCode::kInternal;
}

}  // namespace stipple
