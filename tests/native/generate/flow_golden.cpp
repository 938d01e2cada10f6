#include "flow_golden.h"

#include <gtest/gtest.h>

#include <cmath>

namespace stipple::testing {

const FlowGolden& flowGolden() {
  static const FlowGolden& golden =
      *new FlowGolden(STIPPLE_TEST_DATA "/networks/deg_flow_a.safetensors", "weights.");
  return golden;
}

ImageCondition flowCondition() {
  return flowGolden().condition("input.feature1", "input.feature2");
}

const FlowGolden& pipelineGolden() {
  static const FlowGolden& golden =
      *new FlowGolden(STIPPLE_TEST_DATA "/networks/deg_pipeline_a.safetensors", "weights.flow.");
  return golden;
}

ImageCondition pipelineCondition() {
  return pipelineGolden().condition("expect.feature1", "expect.feature2");
}

void expectLatentsNear(const Latent& seen, const Latent& expected, float tolerance) {
  ASSERT_EQ(seen.token_count, expected.token_count);
  ASSERT_EQ(seen.tokens.size(), expected.tokens.size());
  float worst = 0;
  for (size_t i = 0; i < seen.tokens.size(); ++i) {
    worst = std::max(worst, std::abs(seen.tokens[i] - expected.tokens[i]));
  }
  EXPECT_LE(worst, tolerance) << "tokens";
  for (size_t i = 0; i < kCameraWidth; ++i) {
    EXPECT_NEAR(seen.camera[i], expected.camera[i], tolerance) << "camera " << i;
  }
}

void expectSameLatents(const Latent& seen, const Latent& expected) {
  EXPECT_EQ(seen.tokens, expected.tokens);
  EXPECT_EQ(seen.camera, expected.camera);
}

}  // namespace stipple::testing
