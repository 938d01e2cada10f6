// The step in plain C++; adam_kernel_vector.cpp does the same with lanes along the elements.

#include <cmath>

#include "train/optimiser/adam_kernel.h"

namespace stipple {

namespace {

float withoutDenormals(float moment) {
  return std::abs(moment) < kSmallestMoment ? 0.0f : moment;
}

bool stepScalar(const AdamFactors& factors, size_t count, float* parameters, const float* gradients,
                float* first_moments, float* second_moments) {
  bool all_usable = true;
  for (size_t i = 0; i < count; ++i) {
    const float g = gradients[i];
    if (!std::isfinite(g) || std::abs(g) > kLargestGradient) {
      all_usable = false;
      continue;
    }
    const float m = first_moments[i] + factors.first_share * (g - first_moments[i]);
    const float v = second_moments[i] + factors.second_share * (g * g - second_moments[i]);
    first_moments[i] = withoutDenormals(m);
    second_moments[i] = withoutDenormals(v);
    const float root = std::sqrt(second_moments[i]) * factors.inverse_root_second;
    parameters[i] -= factors.rate * (first_moments[i] / (root + factors.epsilon));
  }
  return all_usable;
}

}  // namespace

AdamKernel scalarAdamKernel() {
  return {"scalar", stepScalar};
}

}  // namespace stipple
