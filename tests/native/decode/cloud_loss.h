#pragma once

#include <cstdint>
#include <vector>

#include "base/random.h"
#include "data/clouds/splat_cloud.h"

namespace stipple {

/// Sum of factors within +-0.5 times every value of a cloud, in double; its derivative by the
/// values where `gradient`, a cloud of as many splats, is not null.
inline double cloudLoss(const SplatCloud& cloud, SplatCloud* gradient) {
  double sum = 0;
  uint64_t number = 0;
  for (auto values : {&SplatCloud::positions, &SplatCloud::rotations, &SplatCloud::scales,
                      &SplatCloud::opacities, &SplatCloud::sh}) {
    for (size_t i = 0; i < (cloud.*values).size(); ++i) {
      const double factor = unitDouble(keyedBits(7, RandomUse::kFieldStart, number++)) - 0.5;
      sum += factor * static_cast<double>((cloud.*values)[i]);
      if (gradient != nullptr) (gradient->*values)[i] = static_cast<float>(factor);
    }
  }
  return sum;
}

}  // namespace stipple
