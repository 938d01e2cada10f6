#pragma once

#include <cmath>
#include <cstring>
#include <random>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// A cloud of plausible splats: scales over seven decades, all opacities, unit rotations.
inline SplatCloud randomCloud(size_t count, int degree, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  std::normal_distribution<float> normal(0.0f, 1.0f);
  SplatCloud cloud;
  cloud.sh_degree = degree;
  cloud.resize(count);
  for (float& value : cloud.positions) value = 10.0f * normal(random);
  for (float& value : cloud.scales) value = std::pow(10.0f, -6.0f + 7.0f * unit(random));
  for (float& value : cloud.opacities) value = unit(random);
  for (float& value : cloud.sh) value = normal(random);
  for (size_t i = 0; i < count; ++i) {
    double norm = 0.0;
    float* q = &cloud.rotations[i * 4];
    for (int k = 0; k < 4; ++k) {
      q[k] = normal(random);
      norm += double(q[k]) * double(q[k]);
    }
    for (int k = 0; k < 4; ++k) q[k] = static_cast<float>(double(q[k]) / std::sqrt(norm));
  }
  return cloud;
}

}  // namespace stipple
