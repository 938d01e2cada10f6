#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/error.h"
#include "splat/backward_cases.h"
#include "train/backend/render_backend.h"

// What the tests of the backend share: a camera, options, rates.

namespace stipple::testing {

constexpr RawArray kArrays[] = {RawArray::kPositions, RawArray::kRotations, RawArray::kLogScales,
                                RawArray::kLogits, RawArray::kSh};

inline const Camera& camera() {
  static const Camera made = frontCamera(47, 35, 36, 3);
  return made;
}

inline RenderOptions overGrey() {
  RenderOptions options;
  options.with_background = true;
  std::fill(options.background, options.background + 3, 0.5);
  return options;
}

inline std::vector<float> target(uint32_t seed) {
  return randomWeights(pixelCount(camera()) * 3, seed, 0, 1);
}

inline StepOptions rates() {
  StepOptions options;
  options.learning_rates = {1e-3, 2e-3, 5e-3, 2.5e-2, 1e-2, 5e-4};
  return options;
}

/// One whole step of a fit.
inline double fit(RenderBackend& backend, uint32_t picture, const StatisticRequest& request = {},
           const StepOptions& options = rates()) {
  backend.forward(camera(), overGrey());
  const double loss = backend.loss(picture, {}).loss;
  backend.backward(request);
  backend.step(options);
  return loss;
}

inline std::string messageOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.what();
  }
  return "nothing thrown";
}

inline void expectEqual(const RawSplats& a, const RawSplats& b) {
  for (const RawArray array : kArrays) {
    EXPECT_EQ(arrayOf(a, array), arrayOf(b, array)) << static_cast<uint32_t>(array);
  }
}

}  // namespace stipple::testing
