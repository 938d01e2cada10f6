#include "densify/quantities/opacity_forms.h"

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

/// ln(1 + e^x).
double softplus(double x) {
  return std::max(x, 0.0) + std::log1p(std::exp(-std::abs(x)));
}

}  // namespace

float scaledOpacityLogit(float logit, double factor) {
  if (factor >= 1) return logit;
  const double x = static_cast<double>(logit);
  // f o / (1 - f o) = f / (1 - f + e^-x), or f e^x / (1 + (1 - f) e^x): the exponential of what is
  // not positive.
  const double small = std::exp(-std::abs(x));
  const double odds = x >= 0 ? -std::log(1 - factor + small) : x - std::log1p((1 - factor) * small);
  return static_cast<float>(std::log(factor) + odds);
}

float sharedOpacityLogit(float logit) {
  const double x = static_cast<double>(logit);
  // With q = sqrt(1 - o): o' / (1 - o') = (1 - q) / q = o / ((1 + q) q).
  const double log_q = -0.5 * softplus(x);
  return static_cast<float>(-softplus(-x) - std::log1p(std::exp(log_q)) - log_q);
}

}  // namespace stipple
