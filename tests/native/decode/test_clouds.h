#pragma once

#include <cstddef>
#include <cstdint>
#include <random>

#include "data/clouds/splat_cloud.h"

namespace stipple::test {

/// Splats of all kinds in a unit cube.
inline SplatCloud randomCloud(size_t count, uint32_t seed, int degree = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  std::normal_distribution<float> normal;
  SplatCloud cloud;
  cloud.sh_degree = degree;
  cloud.resize(count);
  for (float& x : cloud.positions) x = unit(random);
  for (float& x : cloud.rotations) x = normal(random);
  for (float& x : cloud.scales) x = 0.002f + 0.03f * unit(random);
  for (float& x : cloud.opacities) x = 0.05f + 0.9f * unit(random);
  for (float& x : cloud.sh) x = 0.3f * normal(random);
  return cloud;
}

}  // namespace stipple::test
